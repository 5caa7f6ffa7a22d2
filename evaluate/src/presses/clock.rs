//! Whether two clocks agree: the rate of events against the speed of motion.
//!
//! Input: event counts along time and the motion of a robot, both on the host's clock as far as it
//! is known. Output: the shift that makes them agree best, and how it grows along the session.
//! Both signals are the square roots of their values in bins, minus their mean. The correlation at
//! a shift is the sum of their products divided by the root of the product of their energies, so
//! that a shift with little overlap has a low correlation.
//!
//! Complexity: O(bins with events * shifts) a pass. A first pass has at most 2^14 bins of at least
//! 10 ms; a second one around its peak has bins of 2 ms. Memory: O(bins), 2^21 at most.

/// Bins of the passes.
const COARSE_US: i64 = 10_000;
const FINE_US: i64 = 2_000;
const MAX_COARSE: i64 = 1 << 14;
const MAX_FINE: i64 = 1 << 21;
/// A peak this close to the best is on the slope of the best.
const APART_US: i64 = 300_000;
/// The peak with the smallest shift is chosen among peaks with this share of the best correlation,
/// because presses that repeat evenly fit one period later nearly as well.
const AS_GOOD: f64 = 0.95;
/// Parts of a session, each of at least so many bins with events, whose shifts show the drift.
const MAX_PARTS: usize = 8;
const MIN_PARTS: usize = 3;
const MIN_PART_BINS: usize = 100;
/// Least correlation of a session whose motion explains its events.
const FITS: f64 = 0.4;
/// Least correlation of a part that counts.
const PART: f64 = 0.3;
/// Poses this close are averaged before the comparison, because sensors of force are noisy.
const SMOOTH_US: i64 = 25_000;
/// Times of a session do not exceed it.
const MAX_US: i64 = 1 << 60;

/// A motion from one pose to the next: begin, end, and its size in any unit.
pub(super) type Step = (i64, i64, f64);

/// Which shifts are tried.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shifts {
    /// From minus to plus this many microseconds.
    Within(i64),
    /// All shifts with any overlap.
    All,
}

/// How the clocks agree best.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClockFit {
    /// The time of the events less that of the motion, in microseconds.
    pub shift_us: i64,
    /// Shifts that are nearer to it than this fit about as well.
    pub width_us: i64,
    /// The correlation at this shift, -1 to 1.
    pub correlation: f64,
    /// The best correlation at another peak.
    pub next: f64,
    /// The growth of the shift, if the session has enough parts.
    pub drift: Option<Drift>,
}

/// The growth of an offset along a session.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drift {
    /// Growth in microseconds per second: the sensor's clock is faster by so many parts per
    /// million.
    pub ppm: f64,
    /// Its standard error.
    pub error_ppm: f64,
    /// The total growth over the session, in microseconds.
    pub whole_us: f64,
}

impl ClockFit {
    /// Whether motion explains the events.
    pub fn fits(&self) -> bool {
        self.correlation >= FITS
    }

    /// Whether motion explains the events under this shift alone.
    pub fn is_sure(&self) -> bool {
        self.fits() && self.correlation >= 1.2 * self.next
    }
}

impl Drift {
    /// The line through `(time, offset)` in microseconds by least squares; `None` for less than
    /// three points or no time between them. O(points).
    pub(super) fn of(points: &[(i64, i64)]) -> Option<Self> {
        let count = points.len() as f64;
        let &(t0, o0) = points.first().filter(|_| points.len() >= MIN_PARTS)?;
        let shifted = points.iter().map(|&(t, o)| {
            ((i128::from(t) - i128::from(t0)) as f64, (i128::from(o) - i128::from(o0)) as f64)
        });
        let shifted: Vec<(f64, f64)> = shifted.collect();
        let mean_t = shifted.iter().map(|p| p.0).sum::<f64>() / count;
        let mean_o = shifted.iter().map(|p| p.1).sum::<f64>() / count;
        let square: f64 = shifted.iter().map(|p| (p.0 - mean_t).powi(2)).sum();
        if square <= 0.0 {
            return None;
        }
        let slope = shifted.iter().map(|p| (p.0 - mean_t) * (p.1 - mean_o)).sum::<f64>() / square;
        let rest: f64 = shifted.iter().map(|p| (p.1 - mean_o - slope * (p.0 - mean_t)).powi(2)).sum();
        let error = (rest / (count - 2.0) / square).sqrt();
        let first = shifted.iter().map(|p| p.0).fold(f64::MAX, f64::min);
        let last = shifted.iter().map(|p| p.0).fold(f64::MIN, f64::max);
        Some(Self { ppm: slope * 1e6, error_ppm: error * 1e6, whole_us: slope * (last - first) })
    }

    /// Whether it is more than chance, and amounts to more than `least_us` over the session.
    pub(super) fn matters(&self, least_us: f64) -> bool {
        self.ppm.abs() > 3.0 * self.error_ppm && self.whole_us.abs() > least_us
    }
}

/// The motion of a label between poses at `times_us`, which ascend. O(poses log poses).
///
/// The motion at a pose is the mean of the poses up to 25 ms after it minus the mean of those
/// before it, less the noise: twice the motion that a fifth of the poses stays below. An angle
/// wraps at its `period`. A missing value is that of the pose before. Poses that are further apart
/// than `max_gap_us` say nothing about the motion between them.
pub(super) fn motion(times_us: &[i64], values: &[f64], period: Option<f64>, max_gap_us: i64) -> Vec<Step> {
    let mut sums = vec![0.0];
    let (mut last, mut turned, mut sum) = (values.iter().copied().find(|value| !value.is_nan()), 0.0, 0.0);
    for &value in values {
        let before = last.unwrap_or(0.0);
        let value = if value.is_nan() { before } else { value };
        if let Some(period) = period {
            turned -= ((value - before) / period).round() * period;
        }
        last = Some(value);
        sum += value + turned;
        sums.push(sum);
    }
    let mean = |range: std::ops::Range<usize>| (sums[range.end] - sums[range.start]) / range.len() as f64;
    let (mut first, mut end) = (0, 0);
    let mut steps = Vec::new();
    for (i, pair) in times_us.windows(2).enumerate() {
        let (from, to) = (pair[0], pair[1]);
        while times_us[first] < from.saturating_sub(SMOOTH_US) {
            first += 1;
        }
        while times_us.get(end).is_some_and(|&time| time <= to.saturating_add(SMOOTH_US)) {
            end += 1;
        }
        let size = (mean(i + 1..end) - mean(first..i + 1)).abs();
        if to > from && to.checked_sub(from).is_some_and(|gap| gap <= max_gap_us) && size.is_finite() {
            steps.push((from, to, size));
        }
    }
    let mut sizes: Vec<f64> = steps.iter().map(|step| step.2).collect();
    sizes.sort_by(f64::total_cmp);
    let noise = 2.0 * sizes.get(sizes.len() / 5).copied().unwrap_or(0.0);
    steps.iter_mut().for_each(|step| step.2 = (step.2 - noise).max(0.0));
    steps
}

/// The best fit of one of the `motions` to `rates` (ascending times with counts of events). `None`:
/// there are too few of either, or they do not vary.
///
/// The rate of events follows no label exactly: for a soft dome, it leads the force and lags behind
/// the depth. The shift is the mean over the labels that fit about as well as the best one, at
/// about the same shift.
pub(super) fn fit(rates: &[(i64, f64)], motions: &[Vec<Step>], shifts: Shifts) -> Option<(usize, ClockFit)> {
    let all =
        motions.iter().enumerate().filter_map(|(i, steps)| Some((i, Coarse::of(rates, steps, shifts)?)));
    let all: Vec<(usize, Coarse)> = all.collect();
    let (chosen, best) = all.iter().max_by(|(_, a), (_, b)| a.correlation.total_cmp(&b.correlation))?;
    let fine_us = FINE_US.max(best.longest_us / MAX_FINE + 1);
    let events = Events::new(rates, fine_us)?;
    let exact = |(i, coarse): &(usize, Coarse)| {
        let speed = Speed::new(&motions[*i], fine_us)?;
        Some((events.peak(&speed, coarse.shift_us, 2 * coarse.bin_us)?.0, speed))
    };
    let is_good = |(_, coarse): &&(usize, Coarse)| {
        coarse.correlation >= AS_GOOD * best.correlation
            && (coarse.shift_us - best.shift_us).abs() <= best.wide as i64 * best.bin_us
    };
    let good: Vec<i64> =
        all.iter().filter(is_good).filter_map(exact).map(|(shift_us, _)| shift_us - best.shift_us).collect();
    let shift_us = best.shift_us + good.iter().sum::<i64>() / good.len().max(1) as i64;
    let spread_us = good.iter().max()? - good.iter().min()?;
    let (own_us, speed) = all.iter().find(|(i, _)| i == chosen).and_then(exact)?;
    let drift = Drift::of(&parts(&events, &speed, own_us)).filter(|drift| drift.ppm.is_finite());
    let Coarse { bin_us, wide, correlation, next, .. } = *best;
    let width_us = (wide as i64 * bin_us / 2).max(spread_us);
    Some((*chosen, ClockFit { shift_us, width_us, correlation, next, drift }))
}

/// The best shift in whole bins.
struct Coarse {
    shift_us: i64,
    bin_us: i64,
    /// The longer of the two signals.
    longest_us: i64,
    /// Bins around the peak that fit about as well.
    wide: usize,
    correlation: f64,
    next: f64,
}

impl Coarse {
    fn of(rates: &[(i64, f64)], steps: &[Step], shifts: Shifts) -> Option<Self> {
        let (first, last) = (rates.first()?.0.min(steps.first()?.0), rates.last()?.0.max(steps.last()?.1));
        if first < -MAX_US || last > MAX_US {
            return None;
        }
        let longest_us = (rates.last()?.0 - rates.first()?.0).max(steps.last()?.1 - steps.first()?.0);
        let bin_us = COARSE_US.max(longest_us / MAX_COARSE + 1);
        let (events, speed) = (Events::new(rates, bin_us)?, Speed::new(steps, bin_us)?);
        let range = match shifts {
            Shifts::Within(us) => -us / bin_us..=us / bin_us,
            Shifts::All => events.first() - speed.last()..=events.last() - speed.origin,
        };
        let found: Vec<(i64, f64)> = range.map(|lag| (lag, events.correlation(&speed, lag))).collect();
        let at = |i: usize| found.get(i).map_or(f64::MIN, |found| found.1);
        let peaks = (0..found.len()).filter(|&i| at(i) >= at(i.wrapping_sub(1)) && at(i) >= at(i + 1));
        let peaks: Vec<usize> = peaks.collect();
        let best = peaks.iter().map(|&i| at(i)).fold(f64::MIN, f64::max);
        if best <= 0.0 {
            return None;
        }
        let good = peaks.iter().copied().filter(|&i| at(i) >= AS_GOOD * best);
        let chosen = match shifts {
            Shifts::Within(_) => good.min_by_key(|&i| found[i].0.abs())?,
            Shifts::All => good.max_by(|&a, &b| at(a).total_cmp(&at(b)))?,
        };
        let apart = APART_US / bin_us + 1;
        let others = peaks.iter().filter(|&&i| (found[i].0 - found[chosen].0).abs() > apart);
        let next = others.map(|&i| at(i)).fold(0.0, f64::max);
        let as_good = |i: &usize| at(*i) >= AS_GOOD * at(chosen);
        let wide =
            (chosen..found.len()).take_while(as_good).count() + (0..chosen).rev().take_while(as_good).count();
        let (shift_us, correlation) = (found[chosen].0 * bin_us, at(chosen));
        Some(Self { shift_us, bin_us, longest_us, wide, correlation, next })
    }
}

/// The shift of each part of the session, with its middle.
fn parts(events: &Events, speed: &Speed, shift_us: i64) -> Vec<(i64, i64)> {
    let parts = (events.bins.len() / MIN_PART_BINS).min(MAX_PARTS);
    let size = events.bins.len().checked_div(parts).unwrap_or(0).max(1);
    let shift = |part: &[(i64, f64)]| {
        let part = Events::of_bins(part.to_vec(), events.bin_us)?;
        let (shift, correlation) = part.peak(speed, shift_us, APART_US)?;
        let middle = i64::midpoint(part.first(), part.last()) * events.bin_us;
        (correlation >= PART).then_some((middle, shift))
    };
    events.bins.chunks(size).filter(|part| part.len() == size).filter_map(shift).collect()
}

/// The root of the number of events in each bin with events.
struct Events {
    bin_us: i64,
    /// Index of the bin, counted from time 0, ascending.
    bins: Vec<(i64, f64)>,
    mean: f64,
    energy: f64,
}

impl Events {
    fn new(rates: &[(i64, f64)], bin_us: i64) -> Option<Self> {
        let mut bins: Vec<(i64, f64)> = Vec::new();
        for &(t_us, count) in rates {
            let bin = t_us.div_euclid(bin_us);
            match bins.last_mut() {
                Some((last, sum)) if *last == bin => *sum += count,
                _ => bins.push((bin, count)),
            }
        }
        bins.iter_mut().for_each(|(_, count)| *count = count.sqrt());
        Self::of_bins(bins, bin_us)
    }

    fn of_bins(bins: Vec<(i64, f64)>, bin_us: i64) -> Option<Self> {
        let count = (bins.last()?.0 - bins.first()?.0 + 1) as f64;
        let mean = bins.iter().map(|bin| bin.1).sum::<f64>() / count;
        let energy = bins.iter().map(|bin| bin.1 * bin.1).sum::<f64>() - count * mean * mean;
        (energy > 0.0).then_some(Self { bin_us, bins, mean, energy })
    }

    fn first(&self) -> i64 {
        self.bins.first().map_or(0, |bin| bin.0)
    }

    fn last(&self) -> i64 {
        self.bins.last().map_or(0, |bin| bin.0)
    }

    /// The correlation if the events are `lag` bins later than the motion. O(bins with events).
    fn correlation(&self, speed: &Speed, lag: i64) -> f64 {
        let range = self.first() - lag..=self.last() - lag;
        let energy = (self.energy * speed.squares).sqrt();
        let product: f64 = self.bins.iter().map(|&(bin, value)| value * speed.at(bin - lag)).sum();
        (product - self.mean * speed.sum(range)) / energy
    }

    /// The shift within `radius_us` of `around_us` with the highest correlation, and that
    /// correlation as a share of the maximum for the motion that these events overlap.
    fn peak(&self, speed: &Speed, around_us: i64, radius_us: i64) -> Option<(i64, f64)> {
        let (middle, radius) = (around_us / self.bin_us, radius_us / self.bin_us);
        let lags = middle - radius..=middle + radius;
        let found: Vec<(i64, f64)> = lags.map(|lag| (lag, self.correlation(speed, lag))).collect();
        let best = (0..found.len()).max_by(|&a, &b| found[a].1.total_cmp(&found[b].1))?;
        let (lag, top) = found[best];
        // The top of the parabola through the best and its neighbours.
        let beside = best.checked_sub(1).and_then(|i| found.get(i)).zip(found.get(best + 1));
        let part = beside.map_or(0.0, |(before, after)| {
            let curve = before.1 - 2.0 * top + after.1;
            if curve < 0.0 { 0.5 * (before.1 - after.1) / curve } else { 0.0 }
        });
        let here: f64 = (self.first()..=self.last()).map(|bin| speed.at(bin - lag).powi(2)).sum();
        let share = if here > 0.0 { top * (speed.squares / here).sqrt() } else { 0.0 };
        Some((((lag as f64 + part) * self.bin_us as f64).round() as i64, share))
    }
}

/// The root of the speed in each bin, less its mean.
struct Speed {
    /// Index of the first bin, counted from time 0.
    origin: i64,
    values: Vec<f64>,
    /// Sums of the values before each bin.
    sums: Vec<f64>,
    squares: f64,
}

impl Speed {
    fn new(steps: &[Step], bin_us: i64) -> Option<Self> {
        let origin = steps.first()?.0.div_euclid(bin_us);
        let count = steps.last()?.1.div_euclid(bin_us) - origin + 1;
        let mut values = vec![0.0; usize::try_from(count).ok()?];
        for &(from, to, size) in steps {
            let (length, mut at) = ((to - from) as f64, from);
            while at < to {
                let bin = at.div_euclid(bin_us);
                let end = to.min((bin + 1) * bin_us);
                values[(bin - origin) as usize] += size * (end - at) as f64 / length;
                at = end;
            }
        }
        values.iter_mut().for_each(|value: &mut f64| *value = value.sqrt());
        let mean = values.iter().sum::<f64>() / values.len() as f64;
        values.iter_mut().for_each(|value| *value -= mean);
        let squares: f64 = values.iter().map(|value| value * value).sum();
        let mut sums = vec![0.0];
        sums.extend(values.iter().scan(0.0, |sum, value| {
            *sum += value;
            Some(*sum)
        }));
        (squares > 0.0).then_some(Self { origin, values, sums, squares })
    }

    fn last(&self) -> i64 {
        self.origin + self.values.len() as i64 - 1
    }

    fn at(&self, bin: i64) -> f64 {
        let index = usize::try_from(bin - self.origin).ok();
        index.and_then(|index| self.values.get(index)).copied().unwrap_or(0.0)
    }

    /// The sum of the values in a range of bins.
    fn sum(&self, range: std::ops::RangeInclusive<i64>) -> f64 {
        let clamp = |bin: i64| (bin - self.origin).clamp(0, self.values.len() as i64) as usize;
        self.sums[clamp(range.end() + 1)] - self.sums[clamp(*range.start())]
    }
}

//! A line through any number of points in bounded memory.
//!
//! Consecutive points share a bucket, which keeps the lowest and the highest of them, so that no
//! extreme is lost. If all buckets are full, each two become one, and later buckets are twice as
//! long. O(1) a point, amortised.

/// Maximum number of buckets. A field is narrower than twice as many pixels.
const MAX_BUCKETS: usize = 256;

type Point = (f64, f64);

/// Points in the order of arrival, or the extremes of equal numbers of consecutive points.
#[derive(Clone, Debug)]
pub(crate) struct Decimated {
    /// Number of points of a full bucket.
    length: u64,
    /// Number of points of the last bucket.
    filled: u64,
    /// The lowest and the highest point of each bucket.
    buckets: Vec<[Point; 2]>,
    last: Option<Point>,
}

impl Default for Decimated {
    fn default() -> Self {
        Self { length: 1, filled: 1, buckets: Vec::new(), last: None }
    }
}

impl Decimated {
    /// Adds a point. A point that is not finite is left out.
    pub(crate) fn push(&mut self, x: f64, y: f64) {
        if !(x.is_finite() && y.is_finite()) {
            return;
        }
        self.last = Some((x, y));
        if self.filled < self.length {
            self.filled += 1;
            if let Some(bucket) = self.buckets.last_mut() {
                *bucket = merged(*bucket, [(x, y); 2]);
            }
            return;
        }
        if self.buckets.len() == MAX_BUCKETS {
            let merged = self.buckets.chunks(2).map(|two| merged(two[0], two[two.len() - 1]));
            self.buckets = merged.collect();
            self.length *= 2;
        }
        self.buckets.push([(x, y); 2]);
        self.filled = 1;
    }

    /// The points to draw, in order of x if they came in this order.
    pub(crate) fn points(&self) -> Vec<Point> {
        let mut points = Vec::with_capacity(2 * self.buckets.len() + 1);
        for &[low, high] in &self.buckets {
            let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
            points.push(first);
            if second != first {
                points.push(second);
            }
        }
        points.extend(self.last.filter(|last| points.last() != Some(last)));
        points
    }

    /// The newest point.
    pub(crate) fn last(&self) -> Option<Point> {
        self.last
    }

    /// The highest value.
    pub(crate) fn highest(&self) -> Option<f64> {
        self.buckets.iter().map(|bucket| bucket[1].1).reduce(f64::max)
    }
}

/// The extremes of two buckets, the first of which came earlier.
fn merged([low, high]: [Point; 2], [next_low, next_high]: [Point; 2]) -> [Point; 2] {
    [if next_low.1 < low.1 { next_low } else { low }, if next_high.1 > high.1 { next_high } else { high }]
}

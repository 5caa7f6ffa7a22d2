use meissner_engine::*;
use meissner_kernels::*;
use std::time::Instant;
fn net(
    widths: &[usize],
    pooled: &[usize],
    rule: GraphRule,
    skips: &[(usize, usize)],
    pskip: bool,
) -> Network {
    let mut seed = 1u64;
    let mut r = move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (seed >> 40) as f32 / (1 << 23) as f32 - 1.0
    };
    let mut block = |n: usize, a: usize, b: usize, skip: Option<usize>| Block {
        name: format!("conv{n}"),
        input: n,
        skip,
        conv: SplineConv::new(&SplineParts {
            inputs: a,
            outputs: b,
            kernel: [2, 2, 2],
            weight: (0..8 * a * b).map(|_| r() * (3.0 / a as f32).sqrt()).collect(),
            root: None,
            bias: None,
            norm: Some((vec![1.0; b], vec![0.1; b])),
            elu: true,
        })
        .unwrap(),
    };
    let events = Level {
        scale: 0.5,
        blocks: (0..widths.len() - 1)
            .map(|i| block(i, widths[i], widths[i + 1], skips.iter().find(|s| s.0 == i).map(|s| s.1)))
            .collect(),
    };
    let last = *widths.last().unwrap();
    let mut levels = vec![];
    if !pooled.is_empty() {
        let mut w = vec![last];
        w.extend(pooled);
        levels.push((
            Pooling {
                name: "pool".into(),
                from: widths.len() - 1,
                cell: [Fraction::new(16, 346).unwrap(), Fraction::new(12, 260).unwrap()],
                time: None,
                position: Position::Mean,
            },
            Level {
                scale: 0.4,
                blocks: (0..pooled.len())
                    .map(|i| block(i, w[i], w[i + 1], (pskip && i == 1).then_some(0)))
                    .collect(),
            },
        ));
    }
    let c = pooled.last().copied().unwrap_or(last);
    let from = if pooled.is_empty() { widths.len() - 1 } else { pooled.len() };
    let dense =
        Dense::new(16, c, 2, &(0..32 * c).map(|_| r() * 0.1).collect::<Vec<_>>(), None, Activation::Identity)
            .unwrap();
    Network::new(NetworkParts {
        name: "x".into(),
        span_us: 150_000,
        capacity: 32768,
        graph: rule,
        normalisation: Normalisation::Fixed,
        events,
        pooled: levels,
        readout: Readout { from, columns: 4, rows: 4 },
        dense: vec![DenseLayer { name: "fc".into(), dense }],
    })
    .unwrap()
}
fn main() {
    let events: Vec<Event> = std::fs::read("/tmp/tactile_dots.bin")
        .unwrap()
        .chunks_exact(16)
        .map(|b| {
            Event::new(
                i64::from_le_bytes(b[..8].try_into().unwrap()),
                u16::from_le_bytes([b[8], b[9]]),
                u16::from_le_bytes([b[10], b[11]]),
                b[12] == 1,
            )
        })
        .collect();
    let all = GraphRule { reach: Reach::Knn { k: 16 }, candidates: Candidates::All };
    let graphres = std::sync::Arc::new(net(&[1, 8, 16, 16, 16, 32], &[32, 32], all, &[(3, 2)], true));
    let past = std::sync::Arc::new(net(
        &[1, 8, 8, 16, 16, 16, 32, 32],
        &[],
        GraphRule { reach: Reach::Knn { k: 8 }, candidates: Candidates::Past(Lifetime::Frozen) },
        &[],
        false,
    ));
    let sensor = Sensor::new(240, 180);
    let which = std::env::args().nth(1).unwrap_or_default();
    // window of 7006
    let end = (0..events.len())
        .find(|&i| {
            let lo = events.partition_point(|e| e.t_us < events[i].t_us - 150_000);
            i - lo + 1 == 7006
        })
        .unwrap();
    println!("end {end}");
    if which == "batch" || which.is_empty() {
        for search in [Search::Grid, Search::Exhaustive] {
            let b = Batch::new(graphres.clone(), sensor).unwrap().with_search(search);
            let w = &events[end + 1 - 7006..=end];
            let mut best = vec![];
            for _ in 0..7 {
                let t = Instant::now();
                let tr = b.forward(Stream::new(w)).unwrap();
                best.push(t.elapsed());
                std::hint::black_box(tr);
            }
            best.sort();
            println!("batch {search:?} {:?} min {:?}", best[3], best[0]);
        }
    }
    for (name, net, n) in [("graphres", graphres, 3000), ("past", past, 60000)] {
        if !which.is_empty() && which != name {
            continue;
        }
        let mut e = Engine::new(net, sensor).unwrap();
        let start = end - n.min(end);
        let s0 = start.saturating_sub(20000);
        for ev in &events[s0..start] {
            e.push(*ev);
        }
        e.predict().unwrap();
        let (mut push, mut pred) = (vec![], vec![]);
        for ev in &events[start..end] {
            let t = Instant::now();
            e.push(*ev);
            let t1 = Instant::now();
            e.predict().unwrap();
            let t2 = Instant::now();
            push.push((t1 - t).as_nanos());
            pred.push((t2 - t1).as_nanos());
        }
        push.sort();
        pred.sort();
        let q = |v: &Vec<u128>| {
            format!("p50 {} p99 {} max {}", v[v.len() / 2], v[v.len() * 99 / 100], v[v.len() - 1])
        };
        println!("{name} nodes {} push {} predict {}", e.nodes(), q(&push), q(&pred));
        println!(
            "{:?}",
            e.counters()
                .layers
                .iter()
                .map(|l| (l.recomputed / n as u64, l.unchanged / n as u64))
                .collect::<Vec<_>>()
        );
    }
}

//! Stored values of an engine against the results from its own stored inputs.
//!
//! Neighbourhoods and positions come from a batch, as they do not depend on features; cells are
//! computed once more, in wide integers.

use meissner_engine::frames::{FrameEngine, FrameOptions, Skip};
use meissner_engine::{Aggregation, ConvolutionScratch, Event, Fraction, Pooling, Trace};
use meissner_kernels::{Isa, Lanes, Matrix, Portable, add, clear_negative_zero, maximum};

use meissner_verify::{CheckedEngine, bits};

/// Asserts that every stored row of a block is within the engine's tolerance of the result from its
/// stored inputs, and that maxima and prediction are exactly those of the stored rows.
///
/// # Errors
/// The first value that is not.
pub fn check(checked: &mut CheckedEngine) -> Result<(), String> {
    let got = checked.engine.predict().map_err(|e| e.to_string())?.values.to_vec();
    let trace = checked.batch.trace().map_err(|e| e.to_string())?;
    let network = std::sync::Arc::clone(checked.engine.network());
    let tolerance = checked.engine.tolerance();
    let mut below: Option<(Vec<Matrix>, Vec<[i128; 3]>)> = None;
    for (l, level) in trace.levels.iter().enumerate() {
        let channels = network.channels(l);
        let features: Vec<Matrix> = channels
            .iter()
            .enumerate()
            .map(|(f, &columns)| Matrix::from_rows(columns, &checked.engine.feature(l, f).concat()))
            .collect();
        let cells: Vec<[i128; 3]> = match l {
            0 => vec![],
            _ => level.cells.iter().map(|cell| cell.map(i128::from)).collect(),
        };
        if let Some((below, below_cells)) = &below {
            let (pooling, _) = &network.parts().pooled[l - 1];
            let keys = if l == 1 {
                checked.engine.events().iter().map(|&e| cell_of_event(checked, pooling, e)).collect()
            } else {
                let inner = &network.parts().pooled[l - 2].0;
                below_cells.iter().map(|&cell| cell_of_cell(pooling, inner, cell)).collect::<Vec<_>>()
            };
            let expected = maxima(&below[pooling.from], &keys, &cells);
            same(&format!("maxima of level {l}"), &features[0], &expected)?;
        }
        for (b, block) in network.level(l).blocks.iter().enumerate() {
            let input = &features[block.input];
            if l == 0 && network.parts().graph.is_frozen() {
                // Frozen rows read events that have left: the batch remembers them.
                let expected = &trace.levels[0].features[b + 1];
                let expected: Vec<f32> =
                    (level.first..expected.rows()).flat_map(|row| expected.slice(row)).copied().collect();
                let expected = Matrix::from_rows(block.conv.outputs(), &expected);
                same(&format!("frozen block {b}"), &features[b + 1], &expected)?;
                continue;
            }
            for row in 0..input.rows() {
                let skip = block.skip.map(|skip| features[skip].row(row));
                let reads = level.edges.read(row, input.row(row), skip);
                let mut out = vec![Lanes::ZERO; Lanes::count(block.conv.outputs())];
                block.conv.rows(Isa::best(), input, &[reads], &mut ConvolutionScratch::default(), &mut out);
                let given = out.iter().flat_map(|lanes| lanes.0);
                for (c, (stored, given)) in features[b + 1].values(row).zip(given).enumerate() {
                    if stored.to_bits() != given.to_bits()
                        && (tolerance == 0.0 || (stored - given).abs() > tolerance)
                    {
                        return Err(format!(
                            "level {l} block {b} row {row} channel {c}: {stored}, inputs give {given}"
                        ));
                    }
                }
            }
        }
        below = Some((features, cells));
    }
    let (top, _) = below.unwrap_or_default();
    let expected = prediction(checked, &trace, &top);
    if bits(&got) == bits(&expected) {
        Ok(())
    } else {
        Err(format!("predicted {got:?}, stored rows give {expected:?}"))
    }
}

fn same(what: &str, got: &Matrix, expected: &Matrix) -> Result<(), String> {
    let rows = |m: &Matrix| (0..m.rows()).map(|row| bits(m.slice(row))).collect::<Vec<_>>();
    let (got, expected) = (rows(got), rows(expected));
    if got == expected { Ok(()) } else { Err(format!("{what}: {got:?}, expected {expected:?}")) }
}

/// Cell (x, y, t) of an event.
fn cell_of_event(checked: &CheckedEngine, pooling: &Pooling, event: Event) -> [i128; 3] {
    let sensor = checked.engine.sensor();
    let t = i128::from(event.t_us) - i128::from(checked.batch.stream().epoch_us);
    let span = i128::from(checked.engine.network().parts().span_us);
    [
        pooling.cell[0].cell(event.x.into(), sensor.width.into()),
        pooling.cell[1].cell(event.y.into(), sensor.height.into()),
        pooling.time.map_or(0, |size| size.cell(t, span)),
    ]
}

/// Cell of `pooling` that holds the centre of cell `index` of `inner`; the last one beyond.
fn cell_of_cell(pooling: &Pooling, inner: &Pooling, [x, y, t]: [i128; 3]) -> [i128; 3] {
    let axis = |i: i128, inner: Fraction, outer: Fraction| {
        outer.cell((2 * i + 1) * i128::from(inner.numerator()), 2 * i128::from(inner.denominator()))
    };
    let image = |d: usize, i: i128| {
        let outer = pooling.cell[d];
        axis(i, inner.cell[d], outer).min(outer.cells() as i128 - 1)
    };
    let time = inner.time.zip(pooling.time);
    [image(0, x), image(1, y), time.map_or(0, |(inner, outer)| axis(t, inner, outer))]
}

/// Maximum of the rows of each of `cells`; `keys` has the cell of each row.
fn maxima(features: &Matrix, keys: &[[i128; 3]], cells: &[[i128; 3]]) -> Matrix {
    let mut out = Matrix::zeros(cells.len(), features.columns());
    for (i, cell) in cells.iter().enumerate() {
        let rows = (0..keys.len()).filter(|&row| keys[row] == *cell);
        maximum_of(features, rows, out.row_mut(i));
    }
    out
}

/// The sum over `rows`, part of time after part of time; `part` gives that of a row.
fn sum_of(features: &Matrix, rows: &[usize], part: impl Fn(usize) -> i64, out: &mut [Lanes]) {
    let mut sum = vec![Lanes::ZERO; out.len()];
    for rows in rows.chunk_by(|&a, &b| part(a) == part(b)) {
        sum.fill(Lanes::ZERO);
        rows.iter().for_each(|&row| add(&mut sum, features.row(row)));
        add(out, &sum);
    }
}

fn maximum_of(features: &Matrix, rows: impl Iterator<Item = usize>, out: &mut [Lanes]) {
    let mut rows = rows.peekable();
    if rows.peek().is_none() {
        return;
    }
    out.fill(Lanes::splat(f32::NEG_INFINITY));
    rows.for_each(|row| maximum(Portable, out, [features.row(row)]));
    clear_negative_zero(out);
}

/// The prediction that the stored rows of the last level give.
fn prediction(checked: &CheckedEngine, trace: &Trace, top: &[Matrix]) -> Vec<f32> {
    let network = checked.engine.network();
    let (sensor, readout) = (checked.engine.sensor(), network.parts().readout);
    let features = &top[readout.from];
    let cell = |[x, y]: [usize; 2]| y * readout.columns + x;
    let cells: Vec<usize> = if network.levels() == 1 {
        let of = |e: &Event| {
            let x = usize::from(e.x) * readout.columns / usize::from(sensor.width);
            cell([x, usize::from(e.y) * readout.rows / usize::from(sensor.height)])
        };
        checked.engine.events().iter().map(of).collect()
    } else {
        let axis = |p: f64, cells: usize| ((p * cells as f64).floor().max(0.0) as usize).min(cells - 1);
        let positions = &trace.levels[network.levels() - 1].positions;
        positions.iter().map(|p| cell([axis(p[0], readout.columns), axis(p[1], readout.rows)])).collect()
    };
    let plane = readout.columns * readout.rows;
    let cells: Vec<usize> =
        cells.into_iter().zip(ages(checked, trace)).map(|(cell, age)| age * plane + cell).collect();
    let mut values = Matrix::zeros(plane * network.readout_times(), features.columns());
    let (events, epoch) = (checked.engine.events(), checked.engine.epoch_us().unwrap_or(0));
    let part = |row: usize| (events[row].t_us - epoch) / network.sum_part_us();
    for cell in 0..values.rows() {
        let rows = (0..cells.len()).filter(|&row| cells[row] == cell);
        match readout.aggregation {
            Aggregation::Max => maximum_of(features, rows, values.row_mut(cell)),
            Aggregation::Sum => sum_of(features, &rows.collect::<Vec<_>>(), part, values.row_mut(cell)),
        }
    }
    if let Some(head) = &network.parts().head {
        let image: Vec<f32> = (0..network.readout_times())
            .flat_map(|age| (0..values.columns()).map(move |c| (age, c)))
            .flat_map(|(age, c)| (0..plane).map(move |cell| (age * plane + cell, c)))
            .map(|(row, c)| values.slice(row)[c])
            .collect();
        let options = FrameOptions::new().with_skip(Skip::Nothing);
        let mut engine =
            FrameEngine::with_options(std::sync::Arc::clone(head), options).expect("the network runs");
        engine.push(&image).expect("finite values");
        return engine.predict().expect("a frame was pushed").values.to_vec();
    }
    for layer in &network.parts().dense {
        let mut out = Matrix::zeros(1, layer.dense.outputs());
        layer.dense.run(Isa::best(), values.lanes(), out.row_mut(0));
        values = out;
    }
    values.values(0).collect()
}

/// Number of cells in time by which each row of the last level is older than the newest, or 0.
fn ages(checked: &CheckedEngine, trace: &Trace) -> Vec<usize> {
    let parts = checked.engine.network().parts();
    let top = &trace.levels[trace.levels.len() - 1];
    let time = parts.pooled.first().and_then(|(pooling, _)| pooling.time).filter(|_| parts.readout.by_time);
    let Some(size) = time else { return vec![0; top.positions.len()] };
    let stream = checked.batch.stream();
    let newest = size.cell((stream.now_us - stream.epoch_us).into(), parts.span_us.into());
    top.cells.iter().map(|cell| newest as usize - cell[2] as usize).collect()
}

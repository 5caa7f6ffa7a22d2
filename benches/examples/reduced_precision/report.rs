//! Every variant of one shape, timed beside the engine's rows.

use std::hint::black_box;

use meissner_kernels::{Lanes, SplineScratch, Wide};
use pulp::x86::V4;

use crate::clock::interleaved;
use crate::difference::{TableUpdates, update_by_slots};
use crate::float::{Bytes, FloatRows, Halves, Stage, Weight};
use crate::integer::{IntegerRows, Width};
use crate::problem::{Basis, Error, Problem, ROWS, error};
use crate::table::{Rounded, Span, TableRows};
use crate::vectors::{Balanced, Dot, Fours, Pairs};

/// Levels an axis that attributes are rounded to.
const LEVELS: [usize; 4] = [3, 5, 9, 17];
/// Changed in-edges of a row.
const CHANGED: [usize; 5] = [1, 2, 4, 8, 16];

/// What is timed, and what is known of it.
struct Line {
    name: String,
    /// Of a row.
    multiply_adds: usize,
    /// Of weights.
    bytes: usize,
    error: Option<Error>,
}

/// Lines and their calls; the first is what the others are compared with.
#[derive(Default)]
struct Lines<'a> {
    lines: Vec<Line>,
    calls: Vec<Box<dyn FnMut() + 'a>>,
}

impl<'a> Lines<'a> {
    fn add(
        &mut self,
        name: impl Into<String>,
        [multiply_adds, bytes]: [usize; 2],
        error: Option<Error>,
        call: impl FnMut() + 'a,
    ) {
        self.lines.push(Line { name: name.into(), multiply_adds, bytes, error });
        self.calls.push(Box::new(call));
    }

    /// Times all and prints a row of a table for each.
    fn print(mut self, shape: &str) {
        let mut calls: Vec<&mut dyn FnMut()> =
            self.calls.iter_mut().map(|c| c.as_mut() as &mut dyn FnMut()).collect();
        for (line, (ns, ratio)) in self.lines.iter().zip(interleaved(&mut calls)) {
            let Line { name, multiply_adds, bytes, error } = line;
            let error = error.map_or("|".to_owned(), |e| format!("{:.1e} | {:.1e}", e.max, e.rms));
            let kib = *bytes as f64 / 1024.0;
            let ns = ns / ROWS as f64;
            println!("| {shape} | {name} | {ns:.1} | {ratio:.2} | {multiply_adds} | {kib:.0} | {error} |");
        }
    }
}

/// All variants of `problem`, C -> 16 B channels.
pub(crate) fn shape<const C: usize, const B: usize>(v: V4, problem: &Problem) {
    let name = format!("{C} -> {}, {}", 16 * B, problem.degree);
    rows::<C, B>(v, problem).print(&name);
    tables::<C, B>(problem).print(&name);
    updates::<C, B>(v, problem).print(&name);
}

/// The engine's rows, the basis at hand or not.
fn engine<'a>(lines: &mut Lines<'a>, problem: &'a Problem, basis: Basis) {
    let [sums, weights] = problem.multiply_adds();
    let name =
        if basis == Basis::AtHand { "engine, f32, basis at hand" } else { "engine, f32, basis computed" };
    let (mut scratch, mut out) = (SplineScratch::default(), problem.out());
    let counts = [sums + weights, 4 * weights];
    lines.add(name, counts, None, move || problem.engine(basis, &mut scratch, black_box(&mut out)));
}

/// Items 1 and 2: narrower weights, and integers.
fn rows<const C: usize, const B: usize>(v: V4, problem: &Problem) -> Lines<'_> {
    let mut lines = Lines::default();
    engine(&mut lines, problem, Basis::AtHand);
    floats::<Wide, C, B>(&mut lines, problem, "f32, this code");
    floats::<Halves, C, B>(&mut lines, problem, "bf16 weights");
    floats::<Bytes, C, B>(&mut lines, problem, "i8 weights, f32 sums");
    integers::<Pairs, C, B>(&mut lines, v, problem, Width::I16, "i16 x, i16 sums, i8 weights");
    integers::<Balanced, C, B>(&mut lines, v, problem, Width::I16, "i16 x, 13-bit sums, 12-bit weights");
    integers::<Pairs, C, B>(&mut lines, v, problem, Width::I8, "i8 x, i16 sums, i8 weights");
    integers::<Fours, C, B>(&mut lines, v, problem, Width::I8, "i8 x, 7-bit sums, i8 weights");
    lines
}

fn floats<'a, W: Weight + 'a, const C: usize, const B: usize>(
    lines: &mut Lines<'a>,
    problem: &'a Problem,
    name: &str,
) {
    let mut rows = FloatRows::<W, C, B>::new(problem);
    rows.run(Stage::Whole);
    let error = error(&rows.out, &problem.expected());
    assert!(error.max < if size_of::<W>() == 64 { 1e-5 } else { 0.05 }, "{name}: error {}", error.max);
    let [sums, weights] = problem.multiply_adds();
    let bytes = weights / 16 * size_of::<W>();
    lines.add(name, [sums + weights, bytes], Some(error), move || rows.run(Stage::Whole));
    for (stage, part, count) in [(Stage::Sums, "sums", sums), (Stage::Contraction, "contraction", weights)] {
        if stage == Stage::Contraction || size_of::<W>() == 64 {
            let mut rows = FloatRows::<W, C, B>::new(problem);
            rows.run(Stage::Whole);
            lines.add(format!("... {part} alone"), [count, bytes], None, move || rows.run(stage));
        }
    }
}

fn integers<'a, D: Dot + 'a, const C: usize, const B: usize>(
    lines: &mut Lines<'a>,
    v: V4,
    problem: &Problem,
    width: Width,
    name: &str,
) {
    let expected = problem.expected();
    let made = || {
        let mut rows = IntegerRows::<C, B>::new::<D>(v, problem, width, &expected);
        rows.run::<D>(Stage::Whole);
        rows
    };
    let mut rows = made();
    let error = error(&rows.values(), &expected);
    assert!(error.max < 0.3, "{name}: error {}", error.max);
    let [sums, weights] = problem.multiply_adds();
    let bytes = weights * 4 / D::DEPTH;
    lines.add(name, [sums + weights, bytes], Some(error), move || rows.run::<D>(Stage::Whole));
    for (stage, part, count) in [(Stage::Sums, "sums", sums), (Stage::Contraction, "contraction", weights)] {
        let mut rows = made();
        lines.add(format!("... {part} alone"), [count, bytes], None, move || rows.run::<D>(stage));
    }
}

/// Item 4: attributes on a grid.
fn tables<const C: usize, const B: usize>(problem: &Problem) -> Lines<'_> {
    let mut lines = Lines::default();
    engine(&mut lines, problem, Basis::AtHand);
    engine(&mut lines, problem, Basis::Computed);
    let [sums, weights] = problem.multiply_adds();
    for (levels, span) in LEVELS.into_iter().flat_map(|q| [(q, Span::Whole), (q, Span::Occurring)]) {
        let rounded = Rounded::new(problem, levels, span);
        let off = tabulated::<C, B>(problem, &rounded);
        let mut table = TableRows::<C, B>::new(problem, rounded.clone());
        let of = if span == Span::Whole { "of 0 to 1" } else { "of what occurs" };
        let counts = [problem.degree * C * 16 * B, table.bytes()];
        lines.add(format!("weights from a table, {levels} levels {of}"), counts, Some(off), move || {
            table.run();
        });
        if span == Span::Occurring {
            let counts = [sums + weights, 4 * weights + size_of::<Lanes>() * rounded.bases.len()];
            let (mut scratch, mut out, mut basis) = (SplineScratch::default(), problem.out(), Vec::new());
            lines.add(format!("basis from a table, {levels} levels {of}"), counts, Some(off), move || {
                rounded.look_up(&mut basis);
                let edges = (&rounded.edges[..], &basis[..]);
                problem.engine_over(edges, Basis::AtHand, &mut scratch, black_box(&mut out));
            });
        }
    }
    lines
}

/// The error of rounded attributes, after the rows from tabulated weights were held against the engine's.
fn tabulated<const C: usize, const B: usize>(problem: &Problem, rounded: &Rounded) -> Error {
    let (mut out, mut basis) = (problem.out(), Vec::new());
    rounded.look_up(&mut basis);
    problem.engine_over((&rounded.edges, &basis), Basis::AtHand, &mut SplineScratch::default(), &mut out);
    let mut table = TableRows::<C, B>::new(problem, rounded.clone());
    table.run();
    let between = error(&table.out, &out).max;
    assert!(between < 1e-5, "by weights and by basis differ by {between}");
    error(&out, &problem.expected())
}

/// Item 3: rows in integers, updated for some changed in-edges.
fn updates<const C: usize, const B: usize>(v: V4, problem: &Problem) -> Lines<'_> {
    let mut lines = Lines::default();
    let expected = problem.expected();
    let made = || IntegerRows::<C, B>::new::<Pairs>(v, problem, Width::I8, &expected);
    let [sums, weights] = problem.multiply_adds();
    let mut whole = made();
    let bytes = 2 * weights;
    lines.add("i8 x, recomputed", [sums + weights, bytes], None, move || whole.run::<Pairs>(Stage::Whole));
    let rounded = Rounded::new(problem, 5, Span::Occurring);
    for changed in CHANGED.into_iter().filter(|&changed| changed <= problem.degree) {
        let mut slots = made();
        update_by_slots(&mut slots, problem, changed);
        let count = 2 * changed * 8 * C + weights;
        lines.add(format!("i8 x, {changed} changed, by slots"), [count, bytes], None, move || {
            slots.run::<Pairs>(Stage::Whole);
        });
        let mut table = TableUpdates::new(&made(), problem, &rounded, changed);
        table.run();
        assert!(table.totals == table.scalar_totals(), "totals updated by table");
        let counts = [changed * C * 16 * B, 125 * C * 16 * B * 2];
        lines
            .add(format!("i8 x, {changed} changed, by table of 5 levels"), counts, None, move || table.run());
    }
    lines
}

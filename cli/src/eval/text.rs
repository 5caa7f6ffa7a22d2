//! Figures and matrices as text: shares in percent.

use std::io::{self, Write};

use meissner_models::metrics::{Confusion, MeanStd};

use crate::text::{Table, percent};
use meissner_pipeline::text::grouped;

/// Stands where there is no figure.
pub(super) const NONE: &str = "-";

/// Mean and deviation in percent.
pub(super) fn spread(figure: MeanStd) -> [String; 2] {
    [percent(figure.mean), figure.std.map_or_else(|| NONE.to_owned(), percent)]
}

/// `confusion` of `classes`, summed over `trainings` on the same data, in percent of each row, with what is `counted` in
/// the row: that of one training.
pub(super) fn confusion(
    out: &mut impl Write,
    classes: &[&str],
    counted: &str,
    confusion: &Confusion,
    trainings: usize,
) -> io::Result<()> {
    let mut headings = vec![""];
    headings.extend(classes);
    headings.push(counted);
    let mut table = Table::new(&headings);
    for (class, row) in classes.iter().zip(confusion.rows()) {
        let sum: u64 = row.iter().sum();
        let cell = |&count: &u64| match sum {
            0 => NONE.to_owned(),
            _ => format!("{:.1}", 100.0 * count as f64 / sum as f64),
        };
        let cells = row.iter().map(cell).chain([grouped(sum / trainings.max(1) as u64)]);
        table.row(std::iter::once((*class).to_owned()).chain(cells));
    }
    table.write(out)
}

#[cfg(test)]
mod tests {
    use super::confusion;
    use meissner_models::metrics::Confusion;

    #[test]
    fn what_a_confusion_counts_is_that_of_one_training_for_any_number_of_them() {
        let text = |trainings: usize| {
            let mut matrix = Confusion::new(2);
            for _ in 0..trainings {
                [(0, 0), (0, 0), (0, 1), (1, 1)]
                    .into_iter()
                    .for_each(|(truth, found)| matrix.add(truth, found));
            }
            let mut text = Vec::new();
            confusion(&mut text, &["n", "s"], "windows", &matrix, trainings)
                .expect("a vector takes everything");
            String::from_utf8(text).expect("text")
        };
        assert_eq!(text(5), text(1));
        assert!(text(5).contains("n  66.7   33.3        3"), "{}", text(5));
    }
}

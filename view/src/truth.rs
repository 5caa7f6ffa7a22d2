//! The truth at a time: angles, forces, positions, from the author of the recording.

/// Values over time, linear in between.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// Names in the form of an output and its unit: "`roll_rad`".
    pub names: Vec<String>,
    /// Times in microseconds, ascending, each with a value for each name. NaN: unknown.
    pub rows: Vec<(i64, Vec<f64>)>,
}

impl Truth {
    /// The columns with the truth of these outputs, by "name" or "`name_unit`".
    pub fn columns(&self, outputs: &[String], units: &[String]) -> Vec<Option<usize>> {
        let column = |(output, unit): (&String, &String)| {
            self.names.iter().position(|name| name == output || *name == format!("{output}_{unit}"))
        };
        outputs.iter().zip(units).map(column).collect()
    }

    /// The value of a column at `t_us`; NaN before the first time, after the last one, and where it
    /// is unknown.
    pub fn at(&self, column: usize, t_us: i64) -> f64 {
        let after = self.rows.partition_point(|(t, _)| *t <= t_us);
        let (Some((t0, before)), rest) = (self.rows[..after].last(), &self.rows[after..]) else {
            return f64::NAN;
        };
        let value = |values: &[f64]| values.get(column).copied().unwrap_or(f64::NAN);
        match rest.first() {
            Some((t1, next)) => {
                let share = (t_us - t0) as f64 / (t1 - t0) as f64;
                value(before) + (value(next) - value(before)) * share
            }
            None if *t0 == t_us => value(before),
            None => f64::NAN,
        }
    }
}

//! The part of a recording that is measured.
//!
//! Enters: what `--from` and `--for` ask for, and all events. Leaves: the events with `first + from <= t < first + from + for`,
//! where `first` is the time of the recording's first event.

use meissner_engine::Event;

use meissner_pipeline::PipelineError;

/// A part of a recording, in microseconds from its first event on.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Part {
    pub(super) from_us: Option<i64>,
    pub(super) for_us: Option<i64>,
}

impl Part {
    /// Whether it leaves anything out.
    pub(super) fn is_some(self) -> bool {
        self.from_us.is_some() || self.for_us.is_some()
    }

    /// The events of this part, at most `limit`.
    pub(super) fn take(
        self,
        events: impl Iterator<Item = Result<Event, PipelineError>>,
        limit: usize,
    ) -> Result<Vec<Event>, PipelineError> {
        let mut first_us = None;
        let inside = |event: &Result<Event, PipelineError>| {
            let Ok(event) = event else { return true };
            self.holds(*first_us.get_or_insert(event.t_us), event.t_us)
        };
        events.filter(inside).take(limit).collect()
    }

    fn holds(self, first_us: i64, t_us: i64) -> bool {
        // In i128: times may lie anywhere.
        let begin = i128::from(first_us) + i128::from(self.from_us.unwrap_or(0));
        let t_us = i128::from(t_us);
        (self.from_us.is_none() || t_us >= begin)
            && self.for_us.is_none_or(|length| t_us < begin + i128::from(length))
    }
}

impl std::fmt::Display for Part {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let seconds = |us: i64| us as f64 / 1e6;
        write!(f, "from {} s on", seconds(self.from_us.unwrap_or(0)))?;
        self.for_us.map_or(Ok(()), |length| write!(f, ", for {} s", seconds(length)))
    }
}

#[cfg(test)]
mod tests {
    use super::Part;
    use meissner_engine::Event;

    fn times(part: Part, times: &[i64]) -> Vec<i64> {
        let events = times.iter().map(|&t| Ok(Event::new(t, 0, 0, true)));
        part.take(events, usize::MAX).expect("no event is an error").iter().map(|event| event.t_us).collect()
    }

    #[test]
    fn a_part_begins_at_its_start_and_ends_before_its_end() {
        let all = [100, 1099, 1100, 1101, 1599, 1600];
        assert_eq!(times(Part::default(), &all), all);
        assert_eq!(times(Part { from_us: Some(1000), for_us: None }, &all), all[2..]);
        assert_eq!(times(Part { from_us: None, for_us: Some(1000) }, &all), all[..2]);
        assert_eq!(times(Part { from_us: Some(1000), for_us: Some(500) }, &all), all[2..5]);
        assert_eq!(times(Part { from_us: Some(1), for_us: Some(1) }, &[i64::MAX, i64::MIN]), [0; 0]);
    }

    #[test]
    fn a_whole_recording_holds_events_before_its_first_one() {
        assert_eq!(times(Part::default(), &[5, 3]), [5, 3]);
    }
}

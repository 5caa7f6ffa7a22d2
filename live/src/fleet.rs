//! Live engines for many sensors in one process.
//!
//! Each sensor has an engine in a thread of its own, a queue and counters; only the weights are
//! shared. A sensor that floods fills only its own queue. A sensor whose engine fails or panics
//! gets that error, and the others get their predictions.
//!
//! On Linux, if there are several workers, each has the lowest priority (niceness 19) from when its
//! queue is more than half full until it is a quarter full. This needs the right to lower a
//! niceness again (`RLIMIT_NICE`, `CAP_SYS_NICE`); without it, all workers share the cores equally.

use std::time::Duration;

use crate::worker;
use crate::{Asked, Input, Item, Live, LiveError, Predictor, QueueOptions, TimedAnswer};

/// Live engines of many sensors. Predictions are requested from all of them together. Engines of
/// one `Arc<Network>` share one copy of its weights.
///
/// ```
/// use std::sync::Arc;
/// use std::time::Duration;
///
/// use meissner_engine::{Engine, EngineError, Event, Sensor};
/// use meissner_live::{Fleet, QueueOptions};
/// use meissner_models::{Description, Weights};
///
/// let description = Description::shipped("tactigraph-past").expect("a shipped network");
/// let weights = Weights::shipped("tactigraph-past").expect("its weights");
/// let network = Arc::new(description.network(&weights)?);
/// let sensor = Sensor::new(240, 180);
/// let fingertip = || Ok((Engine::new(Arc::clone(&network), sensor)?, QueueOptions::new()));
/// let fingertips: Result<Vec<_>, EngineError> = (0..3).map(|_| fingertip()).collect();
///
/// let (mut inputs, mut fleet) = Fleet::spawn(fingertips?)?;
/// let events: Vec<Event> = (0..100).map(|x| Event::new(0, x, 90, true)).collect();
/// inputs[1].push_slice(&events)?;
/// let mut nodes = [0; 3];
/// fleet.predict(Duration::from_secs(60), 0..3, |sensor, timely| {
///     nodes[sensor] = timely.map_or(0, |timely| timely.nodes);
/// });
/// assert_eq!(nodes, [0, 100, 0]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Fleet<P: Predictor<Input: Item>> {
    sensors: Vec<Live<P>>,
    asked: Vec<(usize, Asked)>,
}

impl<P: Predictor<Input: Item> + Send + 'static> Fleet<P> {
    /// Starts a worker for each of `sensors`, which are numbered by their indices.
    ///
    /// # Errors
    /// As [`Live::spawn`], for the first sensor that cannot start; no worker is left running.
    #[expect(clippy::type_complexity, reason = "as `Live::spawn`, once for each sensor")]
    pub fn spawn(
        sensors: impl IntoIterator<Item = (P, QueueOptions)>,
    ) -> Result<(Vec<Input<P::Input>>, Self), LiveError> {
        let sensors: Vec<_> = sensors.into_iter().collect();
        let gives_way = sensors.len() > 1 && worker::can_restore_priority();
        let spawned =
            sensors.into_iter().map(|(predictor, options)| Live::spawn_beside(predictor, options, gives_way));
        let (inputs, sensors): (Vec<_>, Vec<_>) = spawned.collect::<Result<Vec<_>, _>>()?.into_iter().unzip();
        let asked = Vec::with_capacity(sensors.len());
        Ok((inputs, Self { sensors, asked }))
    }
}

impl<P: Predictor<Input: Item>> Fleet<P> {
    /// The predictions of `sensors` by one deadline, as [`Live::predict`]; all predictions are
    /// requested first. `each` gets every sensor's number and its prediction or error, in the order
    /// of `sensors`.
    ///
    /// # Panics
    /// If a number is not below [`Self::len`].
    pub fn predict(
        &mut self,
        deadline: Duration,
        sensors: impl IntoIterator<Item = usize>,
        mut each: impl FnMut(usize, Result<TimedAnswer<'_>, LiveError>),
    ) {
        let Self { sensors: all, asked } = self;
        asked.clear();
        asked.extend(sensors.into_iter().map(|sensor| (sensor, all[sensor].ask(deadline))));
        for (sensor, asked) in asked {
            let live = &mut all[*sensor];
            let timely = live.wait(asked, deadline).and_then(|_| live.timely(asked));
            each(*sensor, timely);
        }
    }

    /// The live engine of each sensor.
    pub fn sensors(&mut self) -> &mut [Live<P>] {
        &mut self.sensors
    }

    /// The live engine of each sensor, for callers that end them one by one.
    pub fn into_sensors(self) -> Vec<Live<P>> {
        self.sensors
    }

    /// The number of sensors.
    pub fn len(&self) -> usize {
        self.sensors.len()
    }

    /// Whether there is no sensor.
    pub fn is_empty(&self) -> bool {
        self.sensors.is_empty()
    }

    /// Ends every worker, and returns each sensor's engine or the error that ended it, as
    /// [`Live::close`].
    pub fn close(self) -> Vec<Result<P, LiveError>> {
        self.sensors.into_iter().map(Live::close).collect()
    }
}

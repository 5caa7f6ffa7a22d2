//! One service of iceoryx2: slices with a header from one publisher to several subscribers, and
//! notifications that there are some.
//!
//! What is set here, and never left to a default:
//!
//! - A subscriber holds at most [`BUFFER`] slices. Where it is full, the oldest slice makes room for the newest (safe overflow): a publisher
//!   never waits for a subscriber. What is lost shows in the numbers of the headers.
//! - There is one publisher. A second one is refused while the first lives.
//! - A process that was killed leaves memory and a place behind. Each process removes the remains of dead ones when it opens a service.

use std::fmt::Debug;
use std::time::Duration;

use iceoryx2::port::listener::{Listener, ListenerWaitError};
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::Publisher;
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::*;
use iceoryx2::service::builder::publish_subscribe::{
    PublishSubscribeOpenError as OpenError, PublishSubscribeOpenOrCreateError as OpenOrCreateError,
};
use iceoryx2::service::port_factory::{event, publish_subscribe};
use iceoryx2::service::static_config::message_type_details::{TypeDetail, TypeVariant};

use crate::Error;

/// Slices that a subscriber can hold.
pub const BUFFER: usize = 256;
/// Subscribers of a service.
pub const SUBSCRIBERS: usize = 4;
/// How long the remains of a dead process are waited for that another process removes.
const CLEANUP: Duration = Duration::from_secs(1);

/// A service that carries slices of `T` with headers of `H`.
#[derive(Debug)]
pub struct Channel<T: ZeroCopySend + Debug + 'static, H: ZeroCopySend + Debug + 'static> {
    name: String,
    slices: publish_subscribe::PortFactory<ipc::Service, [T], H>,
    notifications: event::PortFactory<ipc::Service>,
    /// The last, because the services belong to it.
    _node: Node<ipc::Service>,
}

/// The end that publishes.
#[derive(Debug)]
pub struct Sender<T: ZeroCopySend + Debug + 'static, H: ZeroCopySend + Debug + 'static> {
    publisher: Publisher<ipc::Service, [T], H>,
    notifier: Notifier<ipc::Service>,
    channel: Channel<T, H>,
}

/// The end that receives.
#[derive(Debug)]
pub struct Receiver<T: ZeroCopySend + Debug + 'static, H: ZeroCopySend + Debug + 'static> {
    subscriber: Subscriber<ipc::Service, [T], H>,
    listener: Listener<ipc::Service>,
    channel: Channel<T, H>,
}

/// A slice that was received. It lies in shared memory, and its place is used again when this is
/// dropped.
pub type Received<T, H> = iceoryx2::sample::Sample<ipc::Service, [T], H>;

impl<T: ZeroCopySend + Debug + 'static, H: ZeroCopySend + Debug + 'static> Channel<T, H> {
    /// Opens the service of this name, or creates it.
    ///
    /// # Errors
    /// [`Error::OtherTypes`] for a service that carries other types, [`Error::Service`] where
    /// iceoryx2 cannot open it.
    pub fn open(name: &str) -> Result<Self, Error> {
        let failed = |step, source: crate::error::Cause| Error::service(name, step, source);
        let service: ServiceName = name.try_into().map_err(|e| failed("use the name", Box::new(e)))?;
        // Signals are the program's.
        let node = NodeBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled);
        let node = node.create::<ipc::Service>().map_err(|e| failed("create a node", Box::new(e)))?;
        node.blocking_cleanup_dead_nodes(CLEANUP);
        let slices = node.service_builder(&service).publish_subscribe::<[T]>().user_header::<H>();
        let slices = slices
            .subscriber_max_buffer_size(BUFFER)
            .subscriber_max_borrowed_samples(2)
            .enable_safe_overflow(true)
            .history_size(0)
            .max_publishers(1)
            .max_subscribers(SUBSCRIBERS)
            .open_or_create();
        let slices = slices.map_err(|error| match error {
            OpenOrCreateError::PublishSubscribeOpenError(OpenError::IncompatibleTypes) => {
                Self::other_types(name, &service)
            }
            error => failed("open it", Box::new(error)),
        })?;
        let notifications = node.service_builder(&service).event();
        let notifications =
            notifications.max_notifiers(2).max_listeners(SUBSCRIBERS).event_id_max_value(0).open_or_create();
        let notifications = notifications.map_err(|e| failed("open its notifications", Box::new(e)))?;
        Ok(Self { name: name.to_owned(), slices, notifications, _node: node })
    }

    fn other_types(name: &str, service: &ServiceName) -> Error {
        let found =
            ipc::Service::details(service, Config::global_config(), MessagingPattern::PublishSubscribe);
        let found = found.ok().flatten().map_or_else(
            || "a service that is gone".to_owned(),
            |found| {
                let types = found.static_details.publish_subscribe().message_type_details();
                format!("{} with {}", text(&types.payload), text(&types.user_header))
            },
        );
        let expected = format!(
            "{} with {}",
            text(&TypeDetail::new::<T>(TypeVariant::Dynamic)),
            text(&TypeDetail::new::<H>(TypeVariant::FixedSize))
        );
        Error::OtherTypes { service: name.to_owned(), expected, found }
    }

    /// The end that publishes slices of at most `most` items.
    ///
    /// # Errors
    /// [`Error::Service`] if another publisher lives.
    pub fn sender(self, most: usize) -> Result<Sender<T, H>, Error> {
        let failed = |step, source: crate::error::Cause| Error::service(&self.name, step, source);
        let publisher = self
            .slices
            .publisher_builder()
            .initial_max_slice_len(most)
            .allocation_strategy(AllocationStrategy::Static)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(|e| failed("publish to it", Box::new(e)))?;
        let notifier = self.notifications.notifier_builder().create();
        let notifier = notifier.map_err(|e| failed("notify of it", Box::new(e)))?;
        Ok(Sender { publisher, notifier, channel: self })
    }

    /// The end that receives, with room for `buffer` slices.
    ///
    /// # Errors
    /// [`Error::Setting`] for a buffer without slices or of more than [`BUFFER`],
    /// [`Error::Service`] if there are too many subscribers.
    pub fn receiver(self, buffer: usize) -> Result<Receiver<T, H>, Error> {
        if !(1..=BUFFER).contains(&buffer) {
            let (expected, found) = (format!("1 to {BUFFER} slices"), buffer.to_string());
            return Err(Error::Setting { what: "buffer", expected, found });
        }
        let failed = |step, source: crate::error::Cause| Error::service(&self.name, step, source);
        // First the listener: a slice that the subscriber gets is then always notified.
        let listener = self.notifications.listener_builder().create();
        let listener = listener.map_err(|e| failed("listen to it", Box::new(e)))?;
        let subscriber = self.slices.subscriber_builder().buffer_size(buffer).create();
        let subscriber = subscriber.map_err(|e| failed("subscribe to it", Box::new(e)))?;
        Ok(Receiver { subscriber, listener, channel: self })
    }
}

/// A type by name and size.
fn text(of: &TypeDetail) -> String {
    format!("{} of {} bytes", of.type_name(), of.size())
}

impl<T: ZeroCopySend + Debug + Copy + 'static, H: ZeroCopySend + Debug + Default + 'static> Sender<T, H> {
    /// Publishes `length` items and their header, written into shared memory by `item`, and
    /// notifies the subscribers. The subscribers that are full lose their oldest slice.
    ///
    /// # Errors
    /// [`Error::Service`] if there is no room: only where a slice is longer than declared, or a
    /// subscriber is broken.
    pub fn publish(&self, header: H, length: usize, item: impl FnMut(usize) -> T) -> Result<(), Error> {
        let failed = |step, source: crate::error::Cause| Error::service(&self.channel.name, step, source);
        let loan = self.publisher.loan_slice_uninit(length);
        let mut slice = loan.map_err(|e| failed("write a slice", Box::new(e)))?;
        *slice.user_header_mut() = header;
        let slice = slice.write_from_fn(item);
        slice.send().map_err(|e| failed("send a slice", Box::new(e)))?;
        self.notifier.notify().map_err(|e| failed("notify of a slice", Box::new(e)))?;
        Ok(())
    }

    /// Subscribers that there are.
    pub fn subscribers(&self) -> usize {
        self.channel.slices.dynamic_config().number_of_subscribers()
    }
}

impl<T: ZeroCopySend + Debug + 'static, H: ZeroCopySend + Debug + 'static> Receiver<T, H> {
    /// The next slice, if there is one.
    ///
    /// # Errors
    /// [`Error::Service`] if the connection is broken.
    pub fn take(&self) -> Result<Option<Received<T, H>>, Error> {
        let taken = self.subscriber.receive();
        taken.map_err(|e| Error::service(&self.channel.name, "receive from it", e))
    }

    /// Sleeps until the publisher notifies, at most for `most`. May return early.
    ///
    /// # Errors
    /// [`Error::Service`] if the notifications are broken.
    pub fn wait(&self, most: Duration) -> Result<(), Error> {
        match self.listener.timed_wait(|_| {}, most) {
            Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
            Err(error) => Err(Error::service(&self.channel.name, "wait for notifications", error)),
        }
    }
}

//! One service of iceoryx2: slices with a header from one publisher to several subscribers.
//!
//! Settings that are made here and never left to a default:
//!
//! - A subscriber holds at most [`BUFFER`] slices. Then the newest replaces the oldest, so a
//!   publisher never waits, and the numbers of the headers show the losses.
//! - There is one publisher. A second one is refused while the first lives.
//! - A killed process leaves memory behind. Each process removes it when it opens a service.

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

use meissner_packets::{Cause, PacketError, failed};

/// Maximum number of slices of a subscriber.
pub const BUFFER: usize = 256;
/// Maximum number of subscribers of a service.
pub const SUBSCRIBERS: usize = 4;
/// Longest wait while another process removes the remains of a dead process.
const CLEANUP: Duration = Duration::from_secs(1);

/// A type that can be in shared memory.
pub trait Shared: ZeroCopySend + Debug + 'static {}

impl<T: ZeroCopySend + Debug + 'static> Shared for T {}

/// A service that carries slices of `T` with headers of `H`.
#[derive(Debug)]
pub struct Channel<T: Shared, H: Shared> {
    name: String,
    slices: publish_subscribe::PortFactory<ipc::Service, [T], H>,
    notifications: event::PortFactory<ipc::Service>,
    /// The last, because the services belong to it.
    _node: Node<ipc::Service>,
}

/// The end that publishes.
#[derive(Debug)]
pub struct Sender<T: Shared, H: Shared> {
    publisher: Publisher<ipc::Service, [T], H>,
    notifier: Notifier<ipc::Service>,
    channel: Channel<T, H>,
}

/// The end that receives.
#[derive(Debug)]
pub struct Receiver<T: Shared, H: Shared> {
    subscriber: Subscriber<ipc::Service, [T], H>,
    listener: Listener<ipc::Service>,
    channel: Channel<T, H>,
}

/// A received slice in shared memory. A drop frees its place.
pub type Received<T, H> = iceoryx2::sample::Sample<ipc::Service, [T], H>;

impl<T: Shared, H: Shared> Channel<T, H> {
    /// Opens the service of this name, or creates it.
    ///
    /// # Errors
    /// The service carries other types, or iceoryx2 cannot open it.
    pub fn open(name: &str) -> Result<Self, PacketError> {
        let service: ServiceName = name.try_into().map_err(cannot(name, "use the name"))?;
        // The program handles signals itself.
        let node = NodeBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled);
        let node = node.create::<ipc::Service>().map_err(cannot(name, "create a node"))?;
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
            error => cannot(name, "open it")(error),
        })?;
        let notifications = node.service_builder(&service).event();
        let notifications =
            notifications.max_notifiers(2).max_listeners(SUBSCRIBERS).event_id_max_value(0).open_or_create();
        let notifications = notifications.map_err(cannot(name, "open its notifications"))?;
        Ok(Self { name: name.to_owned(), slices, notifications, _node: node })
    }

    fn other_types(name: &str, service: &ServiceName) -> PacketError {
        let text = |of: &TypeDetail| format!("{} of {} bytes", of.type_name(), of.size());
        let pair =
            |payload: &TypeDetail, header: &TypeDetail| format!("{} with {}", text(payload), text(header));
        let details =
            ipc::Service::details(service, Config::global_config(), MessagingPattern::PublishSubscribe);
        let found = details.ok().flatten().map(|found| {
            let types = found.static_details.publish_subscribe().message_type_details();
            pair(&types.payload, &types.user_header)
        });
        let (payload, header) = (TypeVariant::Dynamic, TypeVariant::FixedSize);
        let expected = pair(&TypeDetail::new::<T>(payload), &TypeDetail::new::<H>(header));
        let found = found.unwrap_or_else(|| "a service that is gone".to_owned());
        PacketError::unexpected(&format!("service {name}"), &expected, &found)
    }

    /// The end that publishes slices of at most `most` items.
    ///
    /// # Errors
    /// Another publisher lives.
    pub fn sender(self, most: usize) -> Result<Sender<T, H>, PacketError> {
        let publisher = self
            .slices
            .publisher_builder()
            .initial_max_slice_len(most)
            .allocation_strategy(AllocationStrategy::Static)
            .max_loaned_samples(1)
            .backpressure_strategy(BackpressureStrategy::DiscardData)
            .create()
            .map_err(cannot(&self.name, "publish to it"))?;
        let notifier = self.notifications.notifier_builder().create();
        let notifier = notifier.map_err(cannot(&self.name, "notify of it"))?;
        Ok(Sender { publisher, notifier, channel: self })
    }

    /// The end that receives, with room for `buffer` slices.
    ///
    /// # Errors
    /// The buffer has no slices or more than [`BUFFER`], or there are too many subscribers.
    pub fn receiver(self, buffer: usize) -> Result<Receiver<T, H>, PacketError> {
        if !(1..=BUFFER).contains(&buffer) {
            let expected = format!("1 to {BUFFER} slices");
            return Err(PacketError::unexpected("buffer", &expected, &buffer.to_string()));
        }
        // The listener comes first, so that the subscriber is notified of every slice that it gets.
        let listener = self.notifications.listener_builder().create();
        let listener = listener.map_err(cannot(&self.name, "listen to it"))?;
        let subscriber = self.slices.subscriber_builder().buffer_size(buffer).create();
        let subscriber = subscriber.map_err(cannot(&self.name, "subscribe to it"))?;
        Ok(Receiver { subscriber, listener, channel: self })
    }
}

/// iceoryx2 refuses a step.
fn cannot<E: Into<Cause>>(service: &str, step: &str) -> impl FnOnce(E) -> PacketError {
    failed(format!("service {service}: cannot {step}"))
}

impl<T: Shared + Copy, H: Shared + Default> Sender<T, H> {
    /// Publishes `length` items and their header, written into shared memory by `item`, and
    /// notifies the subscribers. Full subscribers lose their oldest slice.
    ///
    /// # Errors
    /// There is no room: a slice is longer than declared, or a subscriber is broken.
    pub fn publish(&self, header: H, length: usize, item: impl FnMut(usize) -> T) -> Result<(), PacketError> {
        let loan = self.publisher.loan_slice_uninit(length);
        let mut slice = loan.map_err(cannot(&self.channel.name, "write a slice"))?;
        *slice.user_header_mut() = header;
        let slice = slice.write_from_fn(item);
        slice.send().map_err(cannot(&self.channel.name, "send a slice"))?;
        self.notifier.notify().map_err(cannot(&self.channel.name, "notify of a slice"))?;
        Ok(())
    }

    /// Number of subscribers.
    pub fn subscribers(&self) -> usize {
        self.channel.slices.dynamic_config().number_of_subscribers()
    }
}

impl<T: Shared, H: Shared> Receiver<T, H> {
    /// The next slice, if there is one.
    ///
    /// # Errors
    /// The connection is broken.
    pub fn take(&self) -> Result<Option<Received<T, H>>, PacketError> {
        self.subscriber.receive().map_err(cannot(&self.channel.name, "receive from it"))
    }

    /// Sleeps until the publisher notifies, at most for `most`. May return early.
    ///
    /// # Errors
    /// The notifications are broken.
    pub fn wait(&self, most: Duration) -> Result<(), PacketError> {
        match self.listener.timed_wait(|_| {}, most) {
            Ok(_) | Err(ListenerWaitError::InterruptSignal) => Ok(()),
            Err(error) => Err(cannot(&self.channel.name, "wait for notifications")(error)),
        }
    }
}

//! The clients, what each of them wants, and who drives what.

use crate::frame::Frame;
use crate::inbox::{ClientId, Inbox, Request, Wish, lock};
use crate::outbox::{Client, Outgoing};
use crate::protocol::{ArmName, Command, Mistake, Overlay, Seat, Servo, Subscription};
use serde_json::{Value, json};
use std::collections::BTreeMap;
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Most clients at a time.
pub(crate) const MAX_CLIENTS: usize = 16;
/// How long a command lives.
pub(crate) const COMMAND_LIFE: Duration = Duration::from_millis(125);
/// Raw inputs that are kept until the next period.
const MAX_RAW: usize = 4096;

/// The parts that frames need for all clients together.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Wants {
    pub stretch: bool,
    pub energy: bool,
    pub contacts: bool,
    pub held: bool,
}

/// A command, when it came, and from whom.
#[derive(Clone, Debug)]
pub(crate) struct Arrived {
    pub command: Command,
    pub at: Instant,
    pub client: ClientId,
}

impl Arrived {
    /// Whether it is still to be followed.
    pub fn is_alive(&self, now: Instant) -> bool {
        now.saturating_duration_since(self.at) <= COMMAND_LIFE && self.command.servo != Servo::Release
    }
}

#[derive(Default)]
struct People {
    clients: BTreeMap<ClientId, Arc<Client>>,
    last: ClientId,
    /// Who has each of [`Seat::ALL`].
    seats: [Option<ClientId>; 3],
    /// The first messages to a new client: status, scene, organs.
    status: Option<Outgoing>,
    scene: Option<Outgoing>,
    organs: Option<Outgoing>,
    frame: Option<Arc<Frame>>,
}

/// Range of the values on organs: stretch, and strain energy (J/m3).
type Ranges = [[f32; 2]; 2];

/// The connection between clients and simulation.
pub(crate) struct Hub {
    /// Why clients may drive nothing, if they only watch.
    watched: Option<&'static str>,
    people: Mutex<People>,
    pub inbox: Inbox,
    commands: Mutex<[Option<Arrived>; 2]>,
    raw: Mutex<Vec<(ArmName, Arrived)>>,
    ranges: Mutex<Ranges>,
    start: Instant,
}

impl Hub {
    /// A hub whose clients may drive what they hold the seats of.
    pub fn new() -> Self {
        Self {
            watched: None,
            people: Mutex::default(),
            inbox: Inbox::default(),
            commands: Mutex::default(),
            raw: Mutex::default(),
            ranges: Mutex::new([[1.0, 1.5], [0.0, 300.0]]),
            start: Instant::now(),
        }
    }

    /// A hub whose clients only watch; `why` is the answer if they try to drive.
    pub fn watched(why: &'static str) -> Self {
        Self { watched: Some(why), ..Self::new() }
    }

    /// Wall time since the server began (s).
    pub fn wall_s(&self, at: Instant) -> f64 {
        at.saturating_duration_since(self.start).as_secs_f64()
    }

    /// Adds a client and sends it `hello` with its number, and what is known; `None` if there are
    /// too many.
    pub fn join(&self, hello: impl FnOnce(ClientId, &Value) -> Value) -> Option<Arc<Client>> {
        let mut people = lock(&self.people);
        if people.clients.len() >= MAX_CLIENTS {
            return None;
        }
        people.last += 1;
        let client = Arc::new(Client::new(people.last));
        let seats = seats_of(&people.seats);
        client.reply(Outgoing::text(&hello(client.id, &seats)));
        for known in [&people.status, &people.scene, &people.organs].into_iter().flatten() {
            client.tell(known);
        }
        if let Some(frame) = &people.frame {
            client.offer(frame, Instant::now());
        }
        people.clients.insert(client.id, Arc::clone(&client));
        drop(people);
        self.refresh(client.id);
        Some(client)
    }

    /// Removes a client, frees its seats, and tells the simulation which arms it drove.
    pub fn leave(&self, id: ClientId) {
        let mut people = lock(&self.people);
        people.clients.remove(&id);
        let had: Vec<Seat> = Seat::ALL.into_iter().filter(|s| people.seats[*s as usize] == Some(id)).collect();
        had.iter().for_each(|seat| people.seats[*seat as usize] = None);
        drop(people);
        for arm in [ArmName::Left, ArmName::Right] {
            if had.contains(&arm.seat()) {
                self.let_go(arm);
                self.inbox.push(Request { client: id, number: None, wish: Wish::Lost(arm) });
            }
        }
        if !had.is_empty() {
            self.tell_seats();
        }
    }

    /// Asks for a frame.
    pub fn refresh(&self, client: ClientId) {
        self.inbox.push(Request { client, number: None, wish: Wish::Refresh });
    }

    /// Ends all connections.
    pub fn close_all(&self) {
        lock(&self.people).clients.values().for_each(|c| c.close());
    }

    /// Sends a reply to one client, if it is still there.
    pub fn reply(&self, id: ClientId, message: Outgoing) {
        let client = lock(&self.people).clients.get(&id).cloned();
        if let Some(client) = client {
            client.reply(message);
        }
    }

    /// Sends a message to all.
    pub fn tell(&self, value: &Value) {
        let message = Outgoing::text(value);
        lock(&self.people).clients.values().for_each(|c| c.tell(&message));
    }

    /// Sends the status to all, and to whoever comes later.
    pub fn tell_status(&self, value: &Value) {
        let message = Outgoing::text(value);
        let mut people = lock(&self.people);
        people.clients.values().for_each(|c| c.tell(&message));
        people.status = Some(message);
    }

    /// Sends scene or organs to all, and to whoever comes later. Frames of before are void.
    pub fn tell_shapes(&self, scene: Option<Vec<u8>>, organs: Option<Vec<u8>>) {
        let mut people = lock(&self.people);
        let message = |bytes: Vec<u8>| Outgoing::Binary(bytes.into());
        let (scene, organs) = (scene.map(message), organs.map(message));
        for client in people.clients.values() {
            client.forget_frame();
            [&scene, &organs].into_iter().flatten().for_each(|m| client.tell(m));
        }
        people.frame = None;
        if scene.is_some() {
            people.scene = scene;
        }
        if organs.is_some() {
            people.organs = organs;
        }
    }

    /// Offers a frame to all. Whoever has not got the one before gets this one instead.
    pub fn offer(&self, frame: &Arc<Frame>) {
        let now = Instant::now();
        let mut people = lock(&self.people);
        people.clients.values().for_each(|c| c.offer(frame, now));
        people.frame = Some(Arc::clone(frame));
    }

    /// Whether any client would get a frame now.
    pub fn wants_frame(&self) -> bool {
        let now = Instant::now();
        lock(&self.people).clients.values().any(|c| c.wants_now(now))
    }

    /// Whether any client gets frames.
    pub fn shows_frames(&self) -> bool {
        lock(&self.people).clients.values().any(|c| c.wants().frames_hz > 0.0)
    }

    /// Offers the last frame again: a client came, or wants other things in it.
    pub fn offer_again(&self) {
        let last = lock(&self.people).frame.clone();
        if let Some(frame) = last {
            self.offer(&frame);
        }
    }

    /// The parts that frames need.
    pub fn wants(&self) -> Wants {
        let mut all = Wants::default();
        for client in lock(&self.people).clients.values() {
            let wants = client.wants();
            all.stretch |= wants.value == Some(Overlay::Stretch);
            all.energy |= wants.value == Some(Overlay::Energy);
            all.contacts |= wants.contacts;
            all.held |= wants.held;
        }
        all
    }

    /// The clients that want haptic models.
    pub fn haptic_clients(&self) -> Vec<Arc<Client>> {
        lock(&self.people).clients.values().filter(|c| c.wants().haptic).cloned().collect()
    }

    /// The clients that are due to get measurements.
    pub fn measured_clients(&self) -> Vec<Arc<Client>> {
        let now = Instant::now();
        lock(&self.people).clients.values().filter(|c| c.is_measured_now(now)).cloned().collect()
    }

    /// Ranges of the values on organs.
    pub fn ranges(&self) -> Ranges {
        *lock(&self.ranges)
    }

    /// Replaces what a client wants.
    pub fn subscribe(&self, client: &Client, wants: Subscription) {
        if let (Some(value), Some(range)) = (wants.value, wants.value_range) {
            lock(&self.ranges)[value as usize] = range;
        }
        client.subscribe(wants);
        self.refresh(client.id);
    }

    /// Whether a client may do what needs `seat`.
    pub fn check(&self, id: ClientId, seat: Seat) -> Result<(), Mistake> {
        if let Some(why) = self.watched {
            return Err(Mistake("seat", why.to_owned()));
        }
        match lock(&self.people).seats[seat as usize] {
            Some(own) if own == id => Ok(()),
            Some(other) => Err(Mistake("seat", taken(seat, other))),
            None => {
                let name = seat.name();
                Err(Mistake(
                    "seat",
                    format!("take the seat '{name}' first: {{\"type\": \"seats\", \"take\": [\"{name}\"]}}"),
                ))
            }
        }
    }

    /// Gives and takes seats: all or none of those that are taken.
    pub fn sit(&self, id: ClientId, take: &[Seat], give: &[Seat]) -> Result<(), Mistake> {
        if let Some(why) = self.watched.filter(|_| !take.is_empty()) {
            return Err(Mistake("seat", why.to_owned()));
        }
        let mut people = lock(&self.people);
        for seat in take {
            if let Some(other) = people.seats[*seat as usize].filter(|own| *own != id) {
                return Err(Mistake("seat", taken(*seat, other)));
            }
        }
        for seat in give {
            if people.seats[*seat as usize] == Some(id) {
                people.seats[*seat as usize] = None;
            }
        }
        take.iter().for_each(|seat| people.seats[*seat as usize] = Some(id));
        drop(people);
        for arm in [ArmName::Left, ArmName::Right] {
            if give.contains(&arm.seat()) {
                self.let_go(arm);
            }
        }
        self.tell_seats();
        Ok(())
    }

    /// Who has which seat.
    pub fn seats(&self) -> Value {
        seats_of(&lock(&self.people).seats)
    }

    fn tell_seats(&self) {
        let mut seats = self.seats();
        seats["type"] = json!("seats");
        self.tell(&seats);
    }

    /// Takes a command in the place of the one before, unless that is newer.
    pub fn command(&self, arm: ArmName, command: Command, client: ClientId) {
        let arrived = Arrived { command, at: Instant::now(), client };
        let mut raw = lock(&self.raw);
        if raw.len() < MAX_RAW {
            raw.push((arm, arrived.clone()));
        }
        drop(raw);
        let slot = &mut lock(&self.commands)[arm as usize];
        let older = |known: &Arrived| known.client == client && known.command.seq >= arrived.command.seq;
        if !slot.as_ref().is_some_and(older) {
            *slot = Some(arrived);
        }
    }

    /// The arm holds its place from the next control period on.
    pub fn let_go(&self, arm: ArmName) {
        if let Some(known) = &mut lock(&self.commands)[arm as usize] {
            known.command.servo = Servo::Release;
        }
    }

    /// The newest commands.
    pub fn commands(&self) -> [Option<Arrived>; 2] {
        lock(&self.commands).clone()
    }

    /// Everything that operators sent since the last call.
    pub fn take_raw(&self) -> Vec<(ArmName, Arrived)> {
        std::mem::take(&mut *lock(&self.raw))
    }
}

fn taken(seat: Seat, by: ClientId) -> String {
    let what = match seat {
        Seat::Controls => "the controls are",
        Seat::Left => "the left arm is",
        Seat::Right => "the right arm is",
    };
    format!("{what} driven by client {by}; it has to give the seat '{}' first", seat.name())
}

fn seats_of(seats: &[Option<ClientId>; 3]) -> Value {
    json!({"controls": seats[0], "left": seats[1], "right": seats[2]})
}

//! Live view: the image so far, sent to the viewer tev while it is rendered (https://github.com/Tom94/tev).

use std::net::{TcpStream, ToSocketAddrs};
use std::str::FromStr;
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow};
use fluxion::film::Layer;
use fluxion::image::Image;
use fluxion::internals::sync::lock;
use fluxion::render::{FilmSink, RenderOutcome};
use tev_client::{PacketCreateImage, PacketUpdateImage, TevClient};

use super::terminal::note;

/// Time between two pictures, which are sent less often where that takes long: at most a twentieth of the time.
const EVERY: Duration = Duration::from_secs(1);
const SHARE: u32 = 20;

/// Time after which nobody listens.
const PATIENCE: Duration = Duration::from_secs(5);

const CHANNELS: [&str; 3] = ["R", "G", "B"];

/// Address that tev listens at: `tev`, `tev:HOST` or `tev:HOST:PORT`.
#[derive(Clone, Debug)]
pub struct Address {
    host: String,
    port: u16,
}

impl FromStr for Address {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let mut parts = text.splitn(3, ':');
        if parts.next() != Some("tev") {
            return Err("the viewer is tev, tev:HOST or tev:HOST:PORT".into());
        }
        let host = parts.next().unwrap_or("127.0.0.1").to_owned();
        let port = parts.next().map_or(Ok(14158), str::parse);
        Ok(Self { host, port: port.map_err(|_| "a port is a number up to 65535")? })
    }
}

impl Address {
    fn connect(&self) -> Result<TcpStream, String> {
        let addresses = (self.host.as_str(), self.port).to_socket_addrs().map_err(|error| error.to_string())?;
        let mut failed = "no such host".to_owned();
        for address in addresses {
            match TcpStream::connect_timeout(&address, PATIENCE) {
                Ok(stream) => {
                    stream.set_write_timeout(Some(PATIENCE)).map_err(|error| error.to_string())?;
                    return Ok(stream);
                }
                Err(error) => failed = error.to_string(),
            }
        }
        Err(failed)
    }
}

/// A picture in tev, which changes as the render goes on.
pub struct Viewer {
    name: String,
    state: Mutex<State>,
}

struct State {
    /// None after tev has gone away.
    client: Option<TevClient>,
    next: Instant,
}

impl Viewer {
    /// Opens a picture. The error says that nobody listens.
    pub fn new(address: &Address, name: &str, (width, height): (usize, usize)) -> Result<Self> {
        let Address { host, port } = address;
        let failed =
            |why: String| anyhow!("no tev at {host}:{port} ({why}): start it, or say where by --display tev:HOST:PORT");
        let mut client = TevClient::wrap(address.connect().map_err(failed)?);
        let (width, height, image_name) = (width as u32, height as u32, name);
        let made = PacketCreateImage { image_name, grab_focus: true, width, height, channel_names: &CHANNELS };
        client.send(made).map_err(|error| failed(error.to_string()))?;
        let state = Mutex::new(State { client: Some(client), next: Instant::now() });
        Ok(Self { name: name.to_owned(), state })
    }

    fn state(&self) -> MutexGuard<'_, State> {
        lock(&self.state)
    }

    /// Shows an image instead of the last one. A viewer that has gone away is said once, and no reason to stop.
    pub fn show(&self, image: &Image) {
        let mut state = self.state();
        let Some(client) = &mut state.client else { return };
        let packet = PacketUpdateImage {
            image_name: &self.name,
            grab_focus: false,
            channel_names: &CHANNELS,
            channel_offsets: &[0, 1, 2],
            channel_strides: &[3; 3],
            x: 0,
            y: 0,
            width: image.width as u32,
            height: image.height as u32,
            data: &image.data,
        };
        if let Err(error) = client.send(packet) {
            note!("warning: tev shows no more of the image: {error}");
            state.client = None;
        }
    }
}

impl FilmSink for Viewer {
    fn due(&self) -> bool {
        let state = self.state();
        state.client.is_some() && Instant::now() >= state.next
    }

    /// Shows the mean of the samples.
    fn put(&self, outcome: &RenderOutcome) {
        let start = Instant::now();
        let frame = outcome.film.develop();
        if let (Some(color), Some(direct)) = (frame.get(Layer::Color), frame.get(Layer::Direct)) {
            let mut image = color.clone();
            image.add(direct);
            self.show(&image);
        }
        self.state().next = Instant::now() + EVERY.max(start.elapsed() * SHARE);
    }
}

//! Pictures on request, rendered in a thread of their own.

use crate::error::Result;
use crate::hub::Hub;
use crate::inbox::ClientId;
use crate::message::{Binary, Data};
use crate::outbox::Outgoing;
use crate::protocol::{Mistake, Quality, error};
use serde_json::json;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use trocar_render::RenderSettings;
use trocar_sensors::CameraRig;
use trocar_task::Episode;

/// Paths per pixel of the best quality, whose noise is filtered out.
const SAMPLES: u32 = 16;

/// The cameras of an episode, made with the first picture.
#[derive(Default)]
pub(crate) struct Pictures {
    rig: Option<CameraRig>,
    busy: Arc<AtomicBool>,
}

impl Pictures {
    /// Renders what `camera` sees now, and sends it to a client. One picture at a time is made.
    ///
    /// # Errors
    /// A camera that is none; a picture that is still being made.
    pub fn make(
        &mut self,
        episode: &Episode,
        (camera, size, quality): (&str, [usize; 2], Quality),
        (hub, client, request): (&Arc<Hub>, ClientId, Option<i64>),
    ) -> std::result::Result<(), Mistake> {
        if self.busy.load(Ordering::Acquire) {
            return Err(Mistake("busy", "another picture is being made; ask again when it is there".to_owned()));
        }
        let mut rig = self.rig(episode).map_err(|why| Mistake("value", why.to_string()))?;
        rig.size(camera).map_err(|why| Mistake("value", why.to_string()))?;
        let (camera, time_s) = (camera.to_owned(), episode.time());
        self.busy.store(true, Ordering::Release);
        let (hub, busy) = (Arc::clone(hub), Arc::clone(&self.busy));
        let settings = match quality {
            Quality::Raster => RenderSettings::preview(),
            Quality::Ray => RenderSettings::Traced { shadows: true },
            Quality::Path => RenderSettings::denoised(SAMPLES),
        };
        let work = move || {
            let made = rig
                .render_still(&camera, size, &settings)
                .map_err(|e| e.to_string())
                .and_then(|picture| picture.color.to_png().map_err(|e| e.to_string()));
            let message = match made {
                Ok(png) => {
                    let mut message = Binary::new(json!({
                        "type": "picture", "request": request, "camera": camera, "width": size[0], "height": size[1],
                        "time_s": time_s, "format": "png",
                    }));
                    message.add("file".to_owned(), &[png.len()], Data::U8(&png));
                    Outgoing::Binary(message.into_bytes().into())
                }
                Err(why) => Outgoing::text(&error(request, &Mistake("internal", why))),
            };
            busy.store(false, Ordering::Release);
            hub.reply(client, message);
        };
        std::thread::Builder::new().name("view-picture".to_owned()).spawn(work).map_err(|why| {
            self.busy.store(false, Ordering::Release);
            Mistake("internal", why.to_string())
        })?;
        Ok(())
    }

    /// A copy of the cameras, with the organs as they are now.
    fn rig(&mut self, episode: &Episode) -> Result<CameraRig> {
        let known = self.rig.take().filter(|rig| rig.is_of(episode.arranged_scene()));
        let mut rig = match known {
            Some(rig) => rig,
            None => CameraRig::new(episode.arranged_scene(), episode.specimen(), episode.cell())?,
        };
        rig.update(episode.cell())?;
        self.rig = Some(rig.clone());
        Ok(rig)
    }
}

//! The common parts of previews through one camera: bodies at rest, and their light.
//!
//! The cameras of a cell do not move, and most of what they see does not move either. Bodies that
//! have rested for a while are drawn and lit once for a camera. Later pictures start with them.

use crate::antialias::{KeptPoints, Refined};
use crate::film::Film;
use crate::light::Light;
use crate::picture::Picture;
use crate::raster::{View, Visibility};
use crate::rays::TILE;
use crate::shading_frame::offset;
use crate::stage::Stage;
use glam::{Mat3A, Vec3A};
use rayon::prelude::*;
use trocar_camera::CameraModel;

/// Number of cameras, each at one pose, of which a background is kept.
const CAMERAS: usize = 4;

/// A body is at rest after so many pictures through a camera in which it has not moved, twice as
/// many whenever it has moved after a rest. Bodies that have not moved between the first two
/// pictures are at rest too.
const REST: u32 = 8;

/// Memory for previews of a stage.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    /// Of the picture that is being made.
    pub visibility: Visibility,
    /// Of the points of its pixels, where edges are smooth.
    pub points: Visibility,
    /// The camera that was used last comes last.
    cameras: Vec<Background>,
}

/// The background of pictures through one camera.
#[derive(Debug)]
pub(crate) struct Background {
    lens: (CameraModel, Option<f32>),
    rotation: Mat3A,
    origin: Vec3A,
    bodies: Vec<Rest>,
    /// Bodies that are drawn.
    visibility: Option<Visibility>,
    /// The same at the points of the pixels, if a picture with smooth edges has asked for it, and
    /// boxes around what their tiles show.
    points: Option<(Visibility, Vec<Option<[Vec3A; 2]>>)>,
    /// The refined pixels of `picture`.
    refined: Option<Refined>,
    /// The light of the last picture.
    look: Option<Look>,
    /// Light of the drawn bodies with that look.
    picture: Option<Picture>,
    /// See [`Behind::boxes`].
    boxes: Vec<Option<[Vec3A; 2]>>,
}

/// How a body has moved.
#[derive(Clone, Copy, Debug)]
struct Rest {
    /// Number of its last change.
    change: u64,
    /// Pictures since then.
    pictures: u32,
    /// Pictures after which it is at rest.
    needed: u32,
    is_drawn: bool,
}

/// A picture of bodies at rest, which others may cover and shade.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Behind<'a> {
    pub visibility: &'a Visibility,
    pub picture: &'a Picture,
    /// For each tile a box around what it shows (m, in the world); `None` if that is nothing.
    pub boxes: &'a [Option<[Vec3A; 2]>],
    bodies: &'a [Rest],
}

/// Everything besides the bodies on which the light of a picture depends.
#[derive(Clone, Debug, PartialEq)]
struct Look {
    lights: Vec<Light>,
    environment: [f32; 3],
    film: Film,
    /// Whether bodies at rest cast shadows on each other.
    shadows: bool,
}

impl<'a> Behind<'a> {
    /// A picture without shadows.
    pub fn unshaded(visibility: &'a Visibility, picture: &'a Picture) -> Self {
        Self { visibility, picture, boxes: &[], bodies: &[] }
    }

    /// Whether a body is in the picture.
    pub fn shows(&self, body: usize) -> bool {
        self.bodies.get(body).is_some_and(|b| b.is_drawn)
    }
}

impl Clone for Memory {
    /// Empty.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl Memory {
    /// The background of a camera, if the bodies last changed in the steps `changes`. It is empty
    /// for the camera's first picture.
    pub fn background(&mut self, view: &View<'_>, changes: impl Iterator<Item = u64>) -> &mut Background {
        let found = self.cameras.iter().position(|b| b.is_of(view)).map(|at| self.cameras.remove(at));
        let background = match found {
            Some(mut background) => {
                background.follow(changes);
                background
            }
            None => Background::new(view, changes),
        };
        if self.cameras.len() >= CAMERAS {
            self.cameras.remove(0);
        }
        let at = self.cameras.len();
        self.cameras.push(background);
        &mut self.cameras[at]
    }
}

impl Background {
    fn new(view: &View<'_>, changes: impl Iterator<Item = u64>) -> Self {
        Self {
            lens: view.rays.lens(),
            rotation: view.rotation,
            origin: view.origin,
            bodies: changes.map(|change| Rest { change, pictures: REST - 1, needed: REST, is_drawn: false }).collect(),
            visibility: None,
            points: None,
            refined: None,
            look: None,
            picture: None,
            boxes: Vec::new(),
        }
    }

    fn is_of(&self, view: &View<'_>) -> bool {
        self.lens == view.rays.lens() && self.rotation == view.rotation && self.origin == view.origin
    }

    /// Notes which bodies have moved since the last picture.
    fn follow(&mut self, changes: impl Iterator<Item = u64>) {
        for (k, change) in changes.enumerate() {
            match self.bodies.get_mut(k) {
                None => self.bodies.push(Rest { change, pictures: 0, needed: REST, is_drawn: false }),
                Some(body) if body.change != change => {
                    let needed = body.needed.saturating_mul(if body.rests() { 2 } else { 1 });
                    *body = Rest { change, pictures: 0, needed, ..*body };
                }
                Some(body) => body.pictures = body.pictures.saturating_add(1),
            }
        }
    }

    /// Whether other bodies are at rest than those that are drawn.
    pub fn is_stale(&self) -> bool {
        self.bodies.iter().any(|b| b.rests() != b.is_drawn)
    }

    /// Whether a body is at rest. None is in the first picture.
    pub fn rests(&self, body: usize) -> bool {
        self.bodies.get(body).is_some_and(Rest::rests)
    }

    /// Whether a body is drawn.
    pub fn shows(&self, body: usize) -> bool {
        self.bodies.get(body).is_some_and(|b| b.is_drawn)
    }

    /// Whether all bodies that are drawn are at rest.
    pub fn is_right(&self) -> bool {
        self.bodies.iter().all(|b| b.rests() || !b.is_drawn)
    }

    /// Keeps the bodies at rest, drawn through `view`. Returns what was kept before, if it was lit.
    pub fn keep(&mut self, drawn: Visibility, view: &View<'_>) -> Option<(Visibility, Picture)> {
        self.bodies.iter_mut().for_each(|b| b.is_drawn = b.rests());
        let kept = self.bodies.iter().any(|b| b.is_drawn).then_some(drawn);
        self.boxes = kept.as_ref().map(|drawn| boxes(drawn, view)).unwrap_or_default();
        (self.points, self.refined) = (None, None);
        std::mem::replace(&mut self.visibility, kept).zip(self.picture.take())
    }

    /// The bodies at rest.
    pub fn visibility(&self) -> Option<&Visibility> {
        self.visibility.as_ref()
    }

    /// Keeps what `draw` draws of the bodies at the points of the pixels, which `view` sees, if
    /// they have no points yet.
    pub fn keep_points(&mut self, view: &View<'_>, draw: impl FnOnce(&Self) -> Visibility) {
        if self.visibility.is_some() && self.points.is_none() {
            let points = draw(self);
            let boxes = boxes(&points, view);
            self.points = Some((points, boxes));
        }
    }

    /// The bodies at rest at the points of the pixels.
    pub fn points(&self) -> Option<&Visibility> {
        self.points.as_ref().map(|(points, _)| points)
    }

    /// Keeps the refined pixels that `refine` makes of the light of the drawn bodies, if that is
    /// known and they are not.
    pub fn keep_refined(&mut self, refine: impl FnOnce(&Self, Picture) -> Refined) {
        if let (Some(picture), Some(_), None) = (&self.picture, &self.points, &self.refined) {
            self.refined = Some(refine(self, picture.clone()));
        }
    }

    /// The points of the pixels with their refined pixels; `moves` says which bodies are not drawn.
    pub fn kept_points<'a>(&'a self, moves: &'a (dyn Fn(usize) -> bool + Sync)) -> Option<KeptPoints<'a>> {
        let ((points, boxes), refined) = (self.points.as_ref()?, self.refined.as_ref()?);
        Some(KeptPoints { refined, points, boxes, moves })
    }

    /// The bodies at rest, to be lit.
    pub fn visibility_mut(&mut self) -> Option<&mut Visibility> {
        self.visibility.as_mut()
    }

    /// Whether [`Self::keep_light`] is worth while: the picture before had this look too.
    pub fn wants_light(&mut self, stage: &Stage, film: Film, shadows: bool) -> bool {
        let same = |l: &Look| {
            l.lights == stage.lights && l.environment == stage.environment && l.film == film && l.shadows == shadows
        };
        if !self.look.as_ref().is_some_and(same) {
            let (lights, environment) = (stage.lights.clone(), stage.environment);
            self.look = Some(Look { lights, environment, film, shadows });
            (self.picture, self.refined) = (None, None);
            return false;
        }
        self.visibility.is_some() && self.picture.is_none()
    }

    /// Keeps a picture of the bodies at rest in the last look.
    pub fn keep_light(&mut self, picture: Picture) {
        (self.picture, self.refined) = (Some(picture), None);
    }

    /// The bodies at rest and, if it is known, their light.
    pub fn lit(&self) -> Option<Behind<'_>> {
        let (visibility, picture) = (self.visibility.as_ref()?, self.picture.as_ref()?);
        Some(Behind { visibility, picture, boxes: &self.boxes, bodies: &self.bodies })
    }
}

/// For each tile a box around what it shows, and a little more: rays start above surfaces.
fn boxes(drawn: &Visibility, view: &View<'_>) -> Vec<Option<[Vec3A; 2]>> {
    let (width, height, stride) = (view.rays.width(), view.rays.height(), view.rays.stride());
    let columns = width.div_ceil(TILE);
    let of_tile = |tile: usize| {
        let (top, left) = (tile / columns * TILE, tile % columns * TILE);
        let mut ends: Option<[Vec3A; 2]> = None;
        for v in top..height.min(top + TILE) {
            for u in left..width.min(left + TILE) {
                let t = drawn.depth[v * stride + u];
                if t < f32::INFINITY {
                    let p = view.origin + view.rotation * view.rays.through(u, v) * t;
                    let margin = Vec3A::splat(2.0 * offset(p));
                    let [low, high] = ends.unwrap_or([Vec3A::INFINITY, Vec3A::NEG_INFINITY]);
                    if !p.is_finite() {
                        return Some([Vec3A::MIN, Vec3A::MAX]);
                    }
                    ends = Some([low.min(p - margin), high.max(p + margin)]);
                }
            }
        }
        ends
    };
    (0..columns * height.div_ceil(TILE)).into_par_iter().map(of_tile).collect()
}

impl Rest {
    fn rests(&self) -> bool {
        self.pictures >= self.needed
    }
}

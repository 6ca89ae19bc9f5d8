//! Transforms between frames: `geometry_msgs`, `tf2_msgs` and foxglove's.

use crate::error::{Parsed, Result};
use crate::reader::Reader;
use crate::ros::{self, fields, of_topic, unknown};
use crate::{Encoding, Topic, foxglove};
use glam::{DQuat, DVec3};
use trocar_core::Pose;

/// A frame's place in another: points of the child frame, rotated and then moved, are points of the parent frame.
///
/// librealsense uses a bare `geometry_msgs/Transform` otherwise; see [`crate::realsense`].
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Transform {
    /// [ns since the epoch]; 0 when the message has none.
    pub stamp: u64,
    /// Name of the parent frame; empty when the message has none.
    pub parent: String,
    /// Name of the child frame; empty when the message has none.
    pub child: String,
    /// Translation [m].
    pub translation: [f64; 3],
    /// Rotation, a unit quaternion x y z w.
    pub rotation: [f64; 4],
}

impl Transform {
    /// The rotation and translation, the rotation made exactly unit.
    pub fn pose(&self) -> Pose {
        Pose {
            rotation: DQuat::from_array(self.rotation).normalize(),
            translation: DVec3::from_array(self.translation),
        }
    }

    /// Refuses numbers that are not finite and rotations that are none.
    fn check(self) -> Parsed<Self> {
        let length = self.rotation.iter().map(|q| q * q).sum::<f64>().sqrt();
        if !(length - 1.0).abs().is_finite() || (length - 1.0).abs() > 0.01 {
            return Err(format!("rotation is {:?}; expected a unit quaternion", self.rotation));
        }
        if self.translation.iter().any(|t| !t.is_finite()) {
            return Err(format!("translation is {:?}; expected finite metres", self.translation));
        }
        Ok(self)
    }
}

/// Decodes transforms: one of `geometry_msgs/Transform` or `TransformStamped` or `foxglove.FrameTransform`, all of
/// `tf2_msgs/TFMessage` or `foxglove.FrameTransforms`.
///
/// # Errors
/// [`Error::Message`](crate::Error::Message) for another type, bytes that end too soon, or a rotation that is none.
pub fn decode_transforms(topic: &Topic, bytes: &[u8]) -> Result<Vec<Transform>> {
    let ros = || fields(topic, bytes);
    let parsed = match (topic.kind.as_str(), &topic.encoding) {
        ("geometry_msgs/Transform", _) => ros().and_then(|mut f| Ok(vec![bare(&mut f)?])),
        ("geometry_msgs/TransformStamped", _) => ros().and_then(|mut f| Ok(vec![stamped(topic, &mut f)?])),
        ("tf2_msgs/TFMessage" | "tf/tfMessage", _) => ros().and_then(|mut f| {
            let count = f.u32()? as usize;
            // The smallest is 56 bytes of numbers, so a wild count ends at the end of the bytes.
            (0..count).map(|_| stamped(topic, &mut f)).collect()
        }),
        ("foxglove.FrameTransform", Encoding::Protobuf) => foxglove::frame_transform(bytes).map(|t| vec![t]),
        ("foxglove.FrameTransform", Encoding::Json) => foxglove::frame_transform_json(bytes).map(|t| vec![t]),
        ("foxglove.FrameTransforms", Encoding::Protobuf) => foxglove::frame_transforms(bytes),
        ("foxglove.FrameTransforms", Encoding::Json) => foxglove::frame_transforms_json(bytes),
        _ => Err(unknown(topic)),
    };
    of_topic(topic, parsed.and_then(|all| all.into_iter().map(Transform::check).collect()))
}

fn bare(f: &mut Reader<'_>) -> Parsed<Transform> {
    Ok(Transform { translation: f.f64s()?, rotation: f.f64s()?, ..Transform::default() })
}

fn stamped(topic: &Topic, f: &mut Reader<'_>) -> Parsed<Transform> {
    let header = ros::header(topic, f)?;
    let child = f.text()?.to_owned();
    Ok(Transform { stamp: header.stamp, parent: header.frame, child, ..bare(f)? })
}

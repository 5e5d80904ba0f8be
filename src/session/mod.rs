//! What clients have made: resident volumes and scenes, shared by every connection.
//!
//! Architecture Invariant: no lock here is held across `.await` or GPU work. A scene has a lock of its own,
//! taken before the store of volumes and never after it.

mod clock;
mod ids;
mod loading;
mod resume;
mod scenes;
mod volumes;

pub use clock::rfc3339;
pub use ids::random_hex;
pub use loading::{Admission, LoadPermit, VolumeSource};
pub use resume::{ResumeStore, View};
pub use scenes::{SceneChange, SceneEntry, SceneSnapshot, SceneStore};
pub use volumes::{NewVolume, Place, VolumeEntry, VolumeLease, VolumeStore, describe, volume_facts};

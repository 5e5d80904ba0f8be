//! What clients have made: volumes and scenes, shared by every connection.
//!
//! Architecture Invariant: no lock here is held across `.await` or GPU work. A scene has a lock of its own,
//! taken before the store of volumes and never after it.

mod admission;
mod clock;
mod entry;
mod ids;
mod loading;
mod place;
mod request;
mod resume;
mod scenes;
mod volumes;

pub use admission::{Admission, LoadPermit};
pub use clock::rfc3339;
pub use entry::{NewVolume, VolumeEntry, describe, volume_facts};
pub use ids::random_hex;
pub use loading::VolumeSource;
pub use place::{Loading, Place, Waiting};
pub use request::{Extent, LoadRequest, Plan, Reduce, Room};
pub use resume::{ResumeStore, View};
pub use scenes::{SceneChange, SceneEntry, SceneSnapshot, SceneStore};
pub use volumes::{VolumeCounts, VolumeLease, VolumeStore};

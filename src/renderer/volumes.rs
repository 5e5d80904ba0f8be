//! The volumes that the renderer knows: on the GPU, or in host memory and ready to go there again.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::rc::{Rc, Weak};
use std::sync::Arc;

use super::request::{RenderError, Residency};
use super::resident::{ResidentVolume, Upload};
use super::work::{Renderer, Turn};
use crate::volume::{Volume, VolumeId};

/// One volume.
#[derive(Debug)]
struct Known {
    volume: Arc<Volume>,
    on_gpu: Option<Rc<ResidentVolume>>,
    /// How far it is on its way back there, while a job brings it.
    arriving: Weak<Cell<f64>>,
    /// When a job last asked for it.
    last_used: u64,
}

impl Known {
    /// On the GPU and of no use to any job now.
    fn is_idle(&self) -> bool {
        self.on_gpu.as_ref().is_some_and(|resident| Rc::strong_count(resident) == 1)
    }
}

/// All volumes.
#[derive(Debug, Default)]
pub(super) struct Volumes {
    known: BTreeMap<VolumeId, Known>,
    clock: u64,
}

impl Volumes {
    pub(super) fn insert(&mut self, id: VolumeId, resident: ResidentVolume) {
        self.clock += 1;
        let volume = resident.volume.clone();
        let known = Known { volume, on_gpu: Some(Rc::new(resident)), arriving: Weak::new(), last_used: self.clock };
        self.known.insert(id, known);
    }

    pub(super) fn remove(&mut self, id: &VolumeId) {
        self.known.remove(id);
    }

    pub(super) fn knows(&self, id: &VolumeId) -> bool {
        self.known.contains_key(id)
    }

    /// The volume on the GPU, if it is there; counts as used now.
    pub(super) fn on_gpu(&mut self, id: &VolumeId) -> Result<Option<Rc<ResidentVolume>>, RenderError> {
        let known = self.known.get_mut(id).ok_or_else(|| RenderError::UnknownVolume(id.clone()))?;
        self.clock += 1;
        known.last_used = self.clock;
        Ok(known.on_gpu.clone())
    }

    /// The volume on the GPU, if it is there.
    pub(super) fn peek(&self, id: &VolumeId) -> Option<Rc<ResidentVolume>> {
        self.known.get(id)?.on_gpu.clone()
    }

    /// The host copy.
    fn host_copy(&self, id: &VolumeId) -> Result<Arc<Volume>, RenderError> {
        let known = self.known.get(id).ok_or_else(|| RenderError::UnknownVolume(id.clone()))?;
        Ok(known.volume.clone())
    }

    /// Volumes on the GPU and their bytes.
    pub(super) fn residents(&self) -> Vec<(VolumeId, u64)> {
        let on_gpu = |(id, known): (&VolumeId, &Known)| Some((id.clone(), known.on_gpu.as_ref()?.bytes()));
        self.known.iter().filter_map(on_gpu).collect()
    }

    /// Volumes that jobs bring back to the GPU, and the share that is there.
    pub(super) fn arriving(&self) -> Vec<(VolumeId, f64)> {
        let arriving = |(id, known): (&VolumeId, &Known)| Some((id.clone(), known.arriving.upgrade()?.get()));
        self.known.iter().filter_map(arriving).collect()
    }

    /// Bytes of the volumes that no job uses now.
    pub(super) fn evictable_bytes(&self) -> u64 {
        let idle = self.known.values().filter(|known| known.is_idle());
        idle.filter_map(|known| known.on_gpu.as_ref()).map(|resident| resident.bytes()).sum()
    }

    /// Takes the idle volume that was not used for longest off the GPU; false when there is none.
    pub(super) fn evict_one(&mut self) -> bool {
        let idle = self.known.iter_mut().filter(|(_, known)| known.is_idle());
        let Some((id, known)) = idle.min_by_key(|(_, known)| known.last_used) else { return false };
        tracing::debug!(volume = id.0, "taken off the GPU to make room");
        known.on_gpu = None;
        true
    }
}

/// A volume on its way to the GPU.
#[derive(Debug)]
pub struct UploadJob {
    id: VolumeId,
    volume: Arc<Volume>,
    upload: Option<Upload>,
}

impl UploadJob {
    /// Nothing is done or reserved yet.
    pub fn new(id: VolumeId, volume: Arc<Volume>) -> Self {
        Self { id, volume, upload: None }
    }

    /// Does a slice of the work.
    ///
    /// # Errors
    /// Any [`RenderError`]; nothing remains on the GPU then.
    pub fn advance(&mut self, renderer: &mut Renderer) -> Result<Turn<Residency>, RenderError> {
        Ok(match advance(renderer, &self.volume, &mut self.upload)? {
            Turn::Pending(fraction) => Turn::Pending(fraction),
            Turn::Done(resident) => {
                let gpu_bytes = resident.bytes();
                renderer.keep_volume(self.id.clone(), resident);
                Turn::Done(Residency { gpu_bytes })
            }
        })
    }
}

/// A volume that a job needs: it is brought back to the GPU where it was taken off, and stays as long as the job.
#[derive(Debug)]
pub(super) struct Needed {
    id: VolumeId,
    resident: Option<Rc<ResidentVolume>>,
    upload: Option<Upload>,
    /// Share of the upload that is done, while there is one.
    fraction: Option<Rc<Cell<f64>>>,
}

impl Needed {
    pub(super) fn new(id: VolumeId) -> Self {
        Self { id, resident: None, upload: None, fraction: None }
    }

    pub(super) fn advance(&mut self, renderer: &mut Renderer) -> Result<Turn<Rc<ResidentVolume>>, RenderError> {
        if let Some(resident) = &self.resident {
            return Ok(Turn::Done(resident.clone()));
        }
        // Another job may have brought it meanwhile.
        if let Some(resident) = renderer.volumes.on_gpu(&self.id)? {
            (self.upload, self.fraction) = (None, None);
            return Ok(Turn::Done(self.resident.insert(resident).clone()));
        }
        let volume = renderer.volumes.host_copy(&self.id)?;
        match advance(renderer, &volume, &mut self.upload)? {
            Turn::Pending(fraction) => {
                let told = self.fraction.get_or_insert_default();
                told.set(fraction);
                if let Some(known) = renderer.volumes.known.get_mut(&self.id) {
                    known.arriving = Rc::downgrade(told);
                }
                Ok(Turn::Pending(fraction))
            }
            Turn::Done(resident) => {
                self.fraction = None;
                let resident = Rc::new(resident);
                if let Some(known) = renderer.volumes.known.get_mut(&self.id) {
                    known.on_gpu = Some(resident.clone());
                }
                Ok(Turn::Done(self.resident.insert(resident).clone()))
            }
        }
    }
}

/// A slice of an upload; the first one reserves memory, and makes room where that helps.
fn advance(
    renderer: &mut Renderer,
    volume: &Arc<Volume>,
    under_way: &mut Option<Upload>,
) -> Result<Turn<ResidentVolume>, RenderError> {
    let Some(mut upload) = under_way.take() else {
        let upload = loop {
            match Upload::new(&renderer.gpu, volume.clone()) {
                Err(error) if renderer.make_room(&error) => {}
                result => break result.map_err(|e| renderer.explain(e))?,
            }
        };
        *under_way = Some(upload);
        return Ok(Turn::Pending(0.0));
    };
    let done = upload.advance(&renderer.gpu, &renderer.stages.gradient);
    if !renderer.with_resident(done)? {
        let fraction = upload.fraction();
        *under_way = Some(upload);
        return Ok(Turn::Pending(fraction));
    }
    Ok(Turn::Done(upload.finish()))
}

//! Whose turn it is.

use std::collections::VecDeque;
use std::sync::Arc;

/// Jobs in groups that take turns: a scene with many watchers gets no more turns than one with a single one.
#[derive(Debug)]
pub struct Turns<T> {
    /// The group at the front is next; within a group, the job at its front. No group is empty.
    groups: VecDeque<(Arc<str>, VecDeque<T>)>,
}

impl<T> Default for Turns<T> {
    fn default() -> Self {
        Self { groups: VecDeque::new() }
    }
}

impl<T> Turns<T> {
    /// Number of jobs.
    pub fn len(&self) -> usize {
        self.groups.iter().map(|g| g.1.len()).sum()
    }

    /// True without jobs.
    pub fn is_empty(&self) -> bool {
        self.groups.is_empty()
    }

    /// Adds a job at the end of its group; a new group waits behind all others.
    pub fn push(&mut self, group: Arc<str>, job: T) {
        match self.groups.iter_mut().find(|g| g.0 == group) {
            Some((_, jobs)) => jobs.push_back(job),
            None => self.groups.push_back((group, VecDeque::from([job]))),
        }
    }

    /// Takes the job whose turn it is; its group goes behind all others.
    pub fn pop(&mut self) -> Option<(Arc<str>, T)> {
        let (group, mut jobs) = self.groups.pop_front()?;
        let job = jobs.pop_front()?;
        if !jobs.is_empty() {
            self.groups.push_back((group.clone(), jobs));
        }
        Some((group, job))
    }
}

//! Who follows long work, and can stop it.

use std::fmt;
use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

use crate::base::error::{Error, Result};

/// How far long work has come.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct Progress {
    /// The number of evaluations of the likelihood so far, including one that is about to run.
    pub evaluations: usize,
    /// The share of the work that is done, 0 to 1, or `None` where the amount of work is unknown. While the
    /// likelihood is searched, it is an estimate.
    pub share: Option<f64>,
}

impl Progress {
    /// A known share of work without a search.
    #[must_use]
    pub fn of_share(share: f64) -> Self {
        Self { share: Some(share), ..Self::default() }
    }
}

/// A callback that runs before each evaluation of a likelihood and many times a second during other long work. It
/// receives the progress so far and decides whether the work continues. It may run in several threads at once. The
/// default observer lets everything run to its end.
#[derive(Clone, Default)]
pub struct Observer(Option<Arc<dyn Fn(Progress) -> ControlFlow<()> + Send + Sync>>);

impl Observer {
    /// An observer that calls `observe`. Work in which it returns [`ControlFlow::Break`] ends with
    /// [`Error::Cancelled`].
    pub fn new(observe: impl Fn(Progress) -> ControlFlow<()> + Send + Sync + 'static) -> Self {
        Self(Some(Arc::new(observe)))
    }
}

impl fmt::Debug for Observer {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(if self.0.is_some() { "Observer" } else { "no observer" })
    }
}

/// Follows some work, or a part of it, for an observer. All threads of the work share it. The default one has no
/// observer.
#[derive(Clone, Debug, Default)]
pub struct Watch {
    observer: Observer,
    /// Evaluations of the likelihood in the whole work, and those before this part.
    evaluations: Arc<AtomicUsize>,
    #[cfg_attr(not(feature = "fit"), expect(dead_code, reason = "only a search counts evaluations"))]
    evaluations_before: usize,
    /// The bits of the largest share so far. Those of numbers that are not negative have the order of the numbers.
    reached: Arc<AtomicU64>,
    /// The shares of the whole work between which this part lies.
    from: f64,
    length: f64,
}

impl Watch {
    /// Follows the whole work.
    #[must_use]
    pub fn new(observer: &Observer) -> Self {
        Self { observer: observer.clone(), length: 1.0, ..Self::default() }
    }

    /// Follows the part of this work between two shares of it.
    #[must_use]
    pub fn part(&self, from: f64, to: f64) -> Self {
        Self {
            from: self.from + from * self.length,
            length: (to - from) * self.length,
            evaluations_before: self.evaluations.load(Ordering::Relaxed),
            ..self.clone()
        }
    }

    /// Counts one evaluation of the likelihood and calls the observer; every evaluation must be preceded by this
    /// call or by that of [`Watch::evaluation_towards`].
    ///
    /// # Errors
    /// [`Error::Cancelled`] where the observer stops the work.
    #[cfg(feature = "fit")]
    pub(crate) fn evaluation(&self) -> Result<()> {
        let evaluations = self.evaluations.fetch_add(1, Ordering::Relaxed) + 1;
        self.tell(Progress { evaluations, share: None })
    }

    /// The same for one evaluation of about `expected` ones, which make up the share `until` of this part.
    ///
    /// # Errors
    /// [`Error::Cancelled`] where the observer stops the work.
    #[cfg(feature = "fit")]
    pub(crate) fn evaluation_towards(&self, expected: usize, until: f64) -> Result<()> {
        let evaluations = self.evaluations.fetch_add(1, Ordering::Relaxed) + 1;
        let here = (evaluations - self.evaluations_before) as f64 / expected.max(1) as f64;
        self.reach(here.min(1.0) * until)
    }

    /// Says that a share of this part is done, or more than was said before.
    ///
    /// # Errors
    /// [`Error::Cancelled`] where the observer stops the work.
    pub fn reach(&self, share: f64) -> Result<()> {
        if self.observer.0.is_none() {
            return Ok(());
        }
        let share = self.from + share.clamp(0.0, 1.0) * self.length;
        let before = f64::from_bits(self.reached.fetch_max(share.to_bits(), Ordering::Relaxed));
        let evaluations = self.evaluations.load(Ordering::Relaxed);
        self.tell(Progress { evaluations, share: Some(share.max(before)) })
    }

    /// Splits this part into `count` equal steps, which threads may take in any order.
    #[must_use]
    pub fn steps(&self, count: usize) -> Steps<'_> {
        Steps { watch: self, count: count.max(1), taken: AtomicUsize::new(0) }
    }

    fn tell(&self, progress: Progress) -> Result<()> {
        match &self.observer.0 {
            Some(observe) if observe(progress).is_break() => Err(Error::Cancelled),
            _ => Ok(()),
        }
    }
}

/// Equal steps of some work.
#[derive(Debug)]
pub struct Steps<'a> {
    watch: &'a Watch,
    count: usize,
    taken: AtomicUsize,
}

impl Steps<'_> {
    /// Says that one more step is done. A step should take between 0.1 and 50 ms, so that work stops at once when
    /// it is cancelled and the call costs nothing that could be measured.
    ///
    /// # Errors
    /// [`Error::Cancelled`] where the observer stops the work.
    pub fn take(&self) -> Result<()> {
        let taken = self.taken.fetch_add(1, Ordering::Relaxed) + 1;
        self.watch.reach(taken as f64 / self.count as f64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn steps_fill_their_part_and_a_broken_off_step_is_an_error() {
        let told = Arc::new(Mutex::new(Vec::new()));
        let keep = Arc::clone(&told);
        let watch = Watch::new(&Observer::new(move |progress| {
            keep.lock().unwrap().push(progress.share.unwrap());
            if progress.share < Some(0.74) { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        }));
        let half = watch.part(0.5, 1.0);
        let steps = half.steps(4);
        assert!(half.reach(0.0).is_ok() && steps.take().is_ok());
        assert!(matches!(steps.take(), Err(Error::Cancelled)));
        assert!(half.part(0.5, 1.0).reach(7.0).is_err() && Watch::default().reach(1.0).is_ok());
        // What is done stays done.
        assert!(watch.reach(0.1).is_err());
        assert_eq!(*told.lock().unwrap(), [0.5, 0.625, 0.75, 1.0, 1.0]);
    }

    #[cfg(feature = "fit")]
    #[test]
    fn evaluations_are_counted_through_all_parts() {
        let told = Arc::new(Mutex::new(Vec::new()));
        let keep = Arc::clone(&told);
        let watch = Watch::new(&Observer::new(move |progress| {
            keep.lock().unwrap().push((progress.evaluations, progress.share));
            ControlFlow::Continue(())
        }));
        watch.evaluation().unwrap();
        let part = watch.part(0.0, 0.5);
        (0..3).for_each(|_| part.evaluation_towards(2, 0.5).unwrap());
        let expected = [(1, None), (2, Some(0.125)), (3, Some(0.25)), (4, Some(0.25))];
        assert_eq!(*told.lock().unwrap(), expected);
    }
}

//! Which stage needs which: the order of stages, upstream first.

use crate::scene::Scene;
use crate::scene::layout::Layout;

/// The stages of a scene and the streams between them. Indices are those of the scene's stages.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Graph {
    parents: Vec<Vec<usize>>,
    ancestors: Vec<Vec<usize>>,
}

impl Graph {
    /// The graph of a scene's stages.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let layout = Layout::of(scene);
        let each = |of: &dyn Fn(usize) -> Vec<usize>| (0..scene.stages.len()).map(of).collect();
        Self { parents: each(&|stage| layout.parents(stage)), ancestors: each(&|stage| layout.ancestors(stage)) }
    }

    /// The stages whose streams a stage replays, ascending.
    #[must_use]
    pub fn parents(&self, stage: usize) -> &[usize] {
        &self.parents[stage]
    }

    /// Everything upstream of a stage, ascending.
    #[must_use]
    pub fn ancestors(&self, stage: usize) -> &[usize] {
        &self.ancestors[stage]
    }

    /// All stages, upstream first; among those that are ready, in the scene's order.
    ///
    /// # Panics
    /// Where the stages form a cycle, which the scene's rules refuse.
    #[must_use]
    pub fn order(&self) -> Vec<usize> {
        let mut order: Vec<usize> = Vec::with_capacity(self.parents.len());
        while order.len() < self.parents.len() {
            let ready = |stage: &usize| {
                !order.contains(stage) && self.parents[*stage].iter().all(|parent| order.contains(parent))
            };
            let next = (0..self.parents.len()).find(ready);
            order.push(next.expect("the scene's rules refuse cycles"));
        }
        order
    }

    /// True where no other stage replays what leaves this one.
    #[must_use]
    pub fn is_leaf(&self, stage: usize) -> bool {
        self.parents.iter().all(|parents| !parents.contains(&stage))
    }
}

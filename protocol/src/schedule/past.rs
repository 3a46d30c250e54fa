//! Questions about revisions of the world before the current one: pictures of them are under way.
//!
//! At an edit, what waits is handed out to those who know the revision that it is about, and only then are they told of the
//! edit: they answer first and edit then ([`crate::serve`]). Nobody else can answer it afterwards; so what a worker had is
//! given up when it does not answer, and whoever asked has something newer under way.

use super::{Action, Moment, Open, QuestionId, Schedule, WorkerId, WorldState};

impl Schedule {
    /// The next revision; what is open about earlier ones is still answered.
    pub(super) fn go_on_to(&mut self, state: WorldState, now: Moment, actions: &mut Vec<Action>) {
        if !self.has_world {
            return self.turn_to(state, true, actions);
        }
        self.cancel_checks(actions);
        self.hand_out(now, actions);
        let before = self.state;
        self.state = state;
        for question in self.open.keys() {
            self.speculation.remove(*question);
        }
        self.inform(Some(before), true, actions);
    }

    /// It is about a revision that workers are leaving, or have left.
    pub(super) fn is_past(&self, open: &Open) -> bool {
        open.question.question.world != self.state
    }

    /// All that nobody holds, to those who know the world, each as much as it has threads for: over their places.
    fn hand_out(&mut self, now: Moment, actions: &mut Vec<Action>) {
        while !self.waiting.is_empty() {
            let able = self.workers.iter().filter(|(_, worker)| {
                worker.is_willing(now)
                    && worker.is_steady()
                    && worker.alone_with.is_none()
                    && worker.told == Some(self.state)
            });
            let load = |worker: &super::Worker| worker.in_flight.len() * LOAD / worker.threads.max(1);
            let Some(id) = able.min_by_key(|(id, worker)| (load(worker), **id)).map(|(id, _)| *id) else { break };
            match self.next_for(id) {
                Some(question) => self.send(id, question, now, actions),
                None => break,
            }
        }
        self.waiting.clear();
        self.suspects.clear();
        let lost = self.open.iter().filter(|(_, open)| open.holders.is_empty()).map(|(id, _)| *id);
        self.lost.extend(lost);
        self.give_up_lost(actions);
    }

    /// Gives up what was about the past, and nobody holds any more.
    pub(super) fn give_up_lost(&mut self, actions: &mut Vec<Action>) {
        for question in std::mem::take(&mut self.lost) {
            if let Some(open) = self.open.remove(&question) {
                self.speculation.remove(question);
                self.counters.given_up += 1;
                let reason = "the scene has been edited meanwhile".to_owned();
                actions.push(Action::GiveUp { asked: open.question, reason });
            }
        }
    }

    /// Nothing is asked any more to compare.
    fn cancel_checks(&mut self, actions: &mut Vec<Action>) {
        let checks: Vec<(QuestionId, Vec<WorkerId>)> = self
            .open
            .iter()
            .filter(|(_, open)| open.check.is_some())
            .map(|(id, open)| (*id, open.holders.iter().copied().collect()))
            .collect();
        for (id, holders) in checks {
            self.open.remove(&id);
            for worker in holders {
                if self.drop_held(worker, id).is_some() {
                    actions.push(Action::Cancel { worker, ids: vec![id] });
                }
            }
        }
        self.forget_checks();
    }
}

/// Questions a thread are counted in such parts.
const LOAD: usize = 1024;

//! What is asked together is absorbed together, whole, in order.
//!
//! A front end asks in *batches*: the questions of a frame, of a pass, of a round of samples. Answers come in any order,
//! late or twice; a batch is taken out when it is complete and all before it are. So what a front end knows is a
//! function of its inputs and of how many batches are in it, whoever answered and when.
//!
//! Batches are numbered 0, 1, 2, … from where the front end began. When it begins again, or another takes its place, their
//! tickets go on counting ([`Batches::next_ticket`]), so that an answer to what was asked before finds nothing.

use std::collections::BTreeMap;

use protocol::question::Ticket;

/// Answers of type `T` to batches of questions, until all of a batch are there.
#[derive(Debug)]
pub struct Batches<T> {
    /// [`Ticket::batch`] of batch 0.
    first_ticket: u32,
    /// Batches before this number were taken out, or came from elsewhere.
    taken: u32,
    /// Batches before this number have been opened.
    opened: u32,
    open: BTreeMap<u32, Batch<T>>,
}

#[derive(Debug)]
struct Batch<T> {
    /// Numbers that it stands for: its own and those that follow.
    span: u32,
    slots: Vec<Slot<T>>,
    missing: usize,
}

/// What is known of one question of a batch.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Slot<T> {
    /// There is nothing to ask.
    Empty,
    /// Asked, or to be asked.
    Missing,
    /// It will never be answered.
    GivenUp,
    /// This is the answer.
    Answered(T),
}

impl<T> Default for Batches<T> {
    fn default() -> Self {
        Self::new(0, 0)
    }
}

impl<T> Batches<T> {
    /// None open; batches before number `taken` are known already, and number 0 has or would have this
    /// [`Ticket::batch`].
    pub fn new(first_ticket: u32, taken: u32) -> Self {
        Self { first_ticket, taken, opened: taken, open: BTreeMap::new() }
    }

    /// The [`Ticket::batch`] from which on nothing was ever asked.
    pub fn next_ticket(&self) -> u32 {
        self.first_ticket.wrapping_add(self.opened)
    }

    /// Opens a batch; a batch that was opened before is left as it is. Batches are opened in order of their numbers.
    pub fn open(&mut self, number: u32, slots: Vec<Slot<T>>) {
        self.open_spanning(number, 1, slots);
    }

    /// As [`Self::open`], for a batch that stands for several numbers: its own and those that follow.
    pub fn open_spanning(&mut self, number: u32, span: u32, slots: Vec<Slot<T>>) {
        let missing = slots.iter().filter(|slot| matches!(slot, Slot::Missing)).count();
        self.open.entry(number).or_insert(Batch { span, slots, missing });
        self.opened = self.opened.max(number.saturating_add(span));
    }

    /// Number of batches that are open.
    pub fn len(&self) -> usize {
        self.open.len()
    }

    /// None is open.
    pub fn is_empty(&self) -> bool {
        self.open.is_empty()
    }

    /// The batch is open.
    pub fn is_open(&self, number: u32) -> bool {
        self.open.contains_key(&number)
    }

    /// Numbers that an open batch stands for.
    pub fn span(&self, number: u32) -> Option<u32> {
        self.open.get(&number).map(|batch| batch.span)
    }

    /// The number after all that are open or were taken out.
    pub fn end(&self) -> u32 {
        self.open.last_key_value().map_or(self.taken, |(number, batch)| number.saturating_add(batch.span))
    }

    /// What a question is asked with.
    pub fn ticket(&self, number: u32, slot: usize) -> Ticket {
        Ticket { batch: self.first_ticket.wrapping_add(number), slot: slot as u32 }
    }

    /// Batch and slot of a ticket whose answer is missing; `None` if nobody waits for one.
    pub fn find(&self, ticket: Ticket) -> Option<(u32, usize)> {
        let (number, slot) = (ticket.batch.wrapping_sub(self.first_ticket), ticket.slot as usize);
        let slots = &self.open.get(&number)?.slots;
        matches!(slots.get(slot), Some(Slot::Missing)).then_some((number, slot))
    }

    /// Keeps an answer that [`Self::find`] found missing; false if it was not.
    pub fn answer(&mut self, (number, slot): (u32, usize), answer: T) -> bool {
        self.fill(number, slot, Slot::Answered(answer))
    }

    /// These slots of all open batches will never be answered, if they are not yet.
    pub fn give_up(&mut self, slots: std::ops::Range<usize>) {
        let numbers: Vec<u32> = self.open.keys().copied().collect();
        for number in numbers {
            for slot in slots.clone() {
                self.fill(number, slot, Slot::GivenUp);
            }
        }
    }

    fn fill(&mut self, number: u32, slot: usize, with: Slot<T>) -> bool {
        let Some(batch) = self.open.get_mut(&number) else { return false };
        match batch.slots.get_mut(slot) {
            Some(missing @ Slot::Missing) => {
                *missing = with;
                batch.missing -= 1;
                true
            }
            _ => false,
        }
    }

    /// The next batch in order, if it is complete.
    pub fn take_complete(&mut self) -> Option<(u32, Vec<Slot<T>>)> {
        self.take_complete_spanning().map(|(number, _, slots)| (number, slots))
    }

    /// The same, and for how many numbers it stands.
    pub fn take_complete_spanning(&mut self) -> Option<(u32, u32, Vec<Slot<T>>)> {
        let (number, batch) = self.open.first_key_value()?;
        if *number != self.taken || batch.missing > 0 {
            return None;
        }
        self.taken += batch.span;
        self.open.pop_first().map(|(number, batch)| (number, batch.span, batch.slots))
    }

    /// Numbers of batches that were taken out, those known from the beginning included.
    pub fn taken(&self) -> u32 {
        self.taken
    }

    /// What has come of a batch; nothing of one that is not open.
    pub fn slots(&self, number: u32) -> &[Slot<T>] {
        self.open.get(&number).map_or(&[], |batch| &batch.slots)
    }

    /// Share of the next batch that is answered, 0..=1; 0 if it is not open.
    pub fn progress(&self) -> f32 {
        let batch = self.open.get(&self.taken);
        batch.map_or(0.0, |batch| 1.0 - batch.missing as f32 / batch.slots.len().max(1) as f32)
    }

    /// Forgets all batches that stand for this number or a later one.
    pub fn cut(&mut self, number: u32) {
        self.open.retain(|open, batch| open.saturating_add(batch.span) <= number);
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn missing(count: usize) -> Vec<Slot<u64>> {
        vec![Slot::Missing; count]
    }

    proptest! {
        /// Answers in any order, some of them twice: batches come out whole, in order, with the same contents.
        #[test]
        fn order_and_repetition_change_nothing(
            sizes in prop::collection::vec(1usize..6, 1..6),
            order in prop::collection::vec(any::<prop::sample::Index>(), 200),
        ) {
            let mut batches = Batches::default();
            let mut tickets = Vec::new();
            for (number, size) in (0u32..).zip(&sizes) {
                batches.open(number, missing(*size));
                tickets.extend((0..*size).map(|slot| batches.ticket(number, slot)));
            }
            let mut out = Vec::new();
            let picks = order.iter().map(|index| tickets[index.index(tickets.len())]).chain(tickets.clone());
            for ticket in picks {
                if let Some(place) = batches.find(ticket) {
                    prop_assert!(batches.answer(place, u64::from(ticket.batch) << 32 | u64::from(ticket.slot)));
                    prop_assert!(!batches.answer(place, 0), "an answer counts once");
                }
                while let Some((number, slots)) = batches.take_complete() {
                    prop_assert_eq!(number as usize, out.len());
                    out.push(slots.len());
                    for (slot, answer) in slots.into_iter().enumerate() {
                        prop_assert_eq!(answer, Slot::Answered(u64::from(number) << 32 | slot as u64));
                    }
                }
            }
            prop_assert_eq!(out, sizes);
            prop_assert!(batches.is_empty());
        }
    }

    #[test]
    fn what_was_asked_before_it_began_again_finds_nothing() {
        let mut before = Batches::default();
        before.open(0, missing(2));
        before.open(1, missing(2));
        let old = [before.ticket(0, 0), before.ticket(1, 1)];
        let mut after: Batches<u64> = Batches::new(before.next_ticket(), 0);
        after.open(0, missing(2));
        after.open(1, missing(2));
        assert!(old.iter().all(|ticket| after.find(*ticket).is_none()));
        assert_eq!(after.find(after.ticket(1, 1)), Some((1, 1)));
    }

    #[test]
    fn a_batch_that_stands_for_several_numbers_is_taken_and_cut_as_a_whole() {
        let mut batches = Batches::default();
        batches.open(0, missing(1));
        batches.open_spanning(1, 9, missing(1));
        batches.open_spanning(10, 9, missing(1));
        assert_eq!((batches.end(), batches.next_ticket(), batches.span(1)), (19, 19, Some(9)));
        assert!(batches.answer((1, 0), 7));
        assert_eq!(batches.take_complete_spanning(), None, "number 0 comes before");
        assert!(batches.answer((0, 0), 6));
        assert_eq!(batches.take_complete_spanning(), Some((0, 1, vec![Slot::Answered(6)])));
        assert_eq!(batches.take_complete_spanning(), Some((1, 9, vec![Slot::Answered(7)])));
        assert_eq!(batches.taken(), 10);
        batches.cut(18);
        assert_eq!((batches.len(), batches.end()), (0, 10), "half of it is not to be had");
    }

    #[test]
    fn what_is_given_up_is_missed_by_no_batch() {
        let mut batches = Batches::default();
        batches.open(0, vec![Slot::Empty, Slot::Missing, Slot::Missing]);
        batches.open(1, missing(3));
        assert!(batches.answer((0, 1), 7));
        assert_eq!(batches.progress(), 1.0 - 1.0 / 3.0);
        batches.give_up(1..3);
        let slots = vec![Slot::Empty, Slot::Answered(7), Slot::GivenUp];
        assert_eq!(batches.take_complete(), Some((0, slots)));
        assert_eq!(batches.take_complete(), None, "one slot of the next is still missing");
        assert!(batches.find(batches.ticket(1, 2)).is_none());
        assert_eq!(batches.taken(), 1);
    }
}

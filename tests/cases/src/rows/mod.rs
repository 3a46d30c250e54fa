//! The table: every case, by row.

pub mod closed_rooms;
pub mod coverage;
pub mod edges;
pub mod emitters;
pub mod faults;
pub mod files;
pub mod glass;
pub mod highlights;
pub mod hunted;
pub mod luminaires;
pub mod materials;
pub mod pictures;
pub mod relief;
pub mod suns;

use crate::case::Case;

/// Rows of the classical table; cases of our own have greater numbers.
pub const CLASSICAL_ROWS: u8 = 43;

/// All cases, by row.
pub fn all() -> Vec<Case> {
    let parts: [&[Case]; 14] = [
        closed_rooms::CASES,
        emitters::CASES,
        glass::CASES,
        highlights::CASES,
        edges::CASES,
        pictures::CASES,
        files::CASES,
        faults::CASES,
        hunted::CASES,
        coverage::CASES,
        materials::CASES,
        relief::CASES,
        suns::CASES,
        luminaires::CASES,
    ];
    let mut cases = parts.concat();
    cases.sort_by_key(|case| case.row);
    cases
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::case::Pace;

    #[test]
    fn every_row_has_a_case_and_every_case_a_name_of_its_own() {
        let cases = all();
        let names: BTreeSet<_> = cases.iter().map(|case| case.name).collect();
        assert_eq!(names.len(), cases.len(), "names are unique");
        let rows: BTreeSet<_> = cases.iter().map(|case| case.row).collect();
        for row in 1..=CLASSICAL_ROWS {
            assert!(rows.contains(&row), "row {row} has no case");
        }
        assert!(cases.iter().all(|case| !case.methods.is_empty()));
        assert!(cases.iter().filter(|case| case.pace == Pace::Quick).count() > 40);
    }
}

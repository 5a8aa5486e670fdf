//! A window that slides over the rows of one segment: speed, and outliers of the torque.
//!
//! Speed is the difference of position over `speed_rows` rows to either side: at 1 kHz the encoder's steps and noise
//! drown a difference of neighbours. An outlier departs from the median of the five rows to either side by more than a
//! number of robust deviations (Hampel's identifier: 1.4826 times the median absolute deviation; 1.2533 times the mean
//! absolute deviation where quantisation makes that zero, after Iglewicz and Hoaglin 1993).

use super::rows::Row;
use crate::{JointVector, MAX_AXES};
use std::collections::VecDeque;

/// Rows to either side among which outliers are sought.
const OUTLIER_ROWS: usize = 5;

/// A row with what its neighbours tell of it.
pub(super) struct Seen {
    pub row: Row,
    /// (rad/s or m/s)
    pub speed: JointVector,
    pub outlier: bool,
}

pub(super) struct Window {
    rows: VecDeque<Row>,
    /// Index of the row to be judged next.
    next: usize,
    speed_rows: usize,
    outliers: Option<f64>,
}

impl Window {
    pub fn new(speed_rows: usize, outliers: Option<f64>) -> Self {
        Self { rows: VecDeque::new(), next: 0, speed_rows, outliers }
    }

    /// Takes a row; hands over the one whose neighbourhood is now complete.
    pub fn push(&mut self, row: Row) -> Option<Seen> {
        self.rows.push_back(row);
        (self.rows.len() > self.next + self.reach()).then(|| self.judge())
    }

    /// Hands over the rest of a segment, row by row; empty after `None`.
    pub fn flush(&mut self) -> Option<Seen> {
        if self.next < self.rows.len() {
            return Some(self.judge());
        }
        self.rows.clear();
        self.next = 0;
        None
    }

    fn reach(&self) -> usize {
        self.speed_rows.max(OUTLIER_ROWS)
    }

    fn judge(&mut self) -> Seen {
        let row = self.rows[self.next];
        let last = self.rows.len() - 1;
        let before = &self.rows[self.next.saturating_sub(self.speed_rows)];
        let after = &self.rows[(self.next + self.speed_rows).min(last)];
        let time = after.time - before.time;
        let rate = |(after, before): (&f64, &f64)| if time > f64::MIN_POSITIVE { (after - before) / time } else { 0.0 };
        let speed = after.q.iter().zip(before.q.iter()).map(rate).collect();
        let seen = Seen { row, speed, outlier: self.outliers.is_some_and(|limit| self.is_outlier(&row, limit)) };
        self.next += 1;
        if self.next > self.reach() {
            self.rows.pop_front();
            self.next -= 1;
        }
        seen
    }

    fn is_outlier(&self, row: &Row, limit: f64) -> bool {
        const MOST: usize = 2 * OUTLIER_ROWS + 1;
        let range = self.next.saturating_sub(OUTLIER_ROWS)..(self.next + OUTLIER_ROWS + 1).min(self.rows.len());
        let count = range.len();
        (0..row.torque.len().min(MAX_AXES)).any(|joint| {
            let mut values = [0.0; MOST];
            values.iter_mut().zip(self.rows.range(range.clone())).for_each(|(value, row)| *value = row.torque[joint]);
            let centre = median(&mut values[..count]);
            let mut departures = values.map(|value| (value - centre).abs());
            let mean = departures[..count].iter().sum::<f64>() / count as f64;
            let middle = median(&mut departures[..count]);
            let deviation = if middle > 0.0 { 1.4826 * middle } else { 1.2533 * mean };
            (row.torque[joint] - centre).abs() > limit * deviation
        })
    }
}

/// The middle value; the upper of two.
fn median(values: &mut [f64]) -> f64 {
    let middle = values.len() / 2;
    *values.select_nth_unstable_by(middle, f64::total_cmp).1
}

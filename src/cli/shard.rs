//! `--shard`: which shard of a bake this process solves, by a number or by what the job scheduler has put into the
//! environment.

use super::Failure;
use crate::sweep::Shard;
use std::str::FromStr;

/// How a scheduler passes a task its number.
struct Variable {
    name: &'static str,
    /// Number of its first task.
    first: usize,
}

/// Schedulers' variables.
const VARIABLES: [Variable; 10] = [
    Variable { name: "SLURM_ARRAY_TASK_ID", first: 0 },
    Variable { name: "HQ_TASK_ID", first: 0 },
    Variable { name: "PBS_ARRAY_INDEX", first: 0 },
    Variable { name: "PBS_ARRAYID", first: 0 },
    // Grid Engine has no task 0; outside of arrays it says "undefined".
    Variable { name: "SGE_TASK_ID", first: 1 },
    Variable { name: "JOB_COMPLETION_INDEX", first: 0 },
    Variable { name: "AWS_BATCH_JOB_ARRAY_INDEX", first: 0 },
    Variable { name: "OMPI_COMM_WORLD_RANK", first: 0 },
    Variable { name: "PMIX_RANK", first: 0 },
    Variable { name: "PMI_RANK", first: 0 },
];

/// A shard as it is asked for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShardChoice {
    /// By its number.
    Given(Shard),
    /// One of so many, by the environment.
    Auto(usize),
}

impl FromStr for ShardChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text.strip_prefix("auto/") {
            None => text.parse().map(Self::Given),
            Some(count) => format!("0/{count}").parse().map(|Shard { count, .. }| Self::Auto(count)),
        }
    }
}

impl ShardChoice {
    /// Returns the shard that is meant; `variable` looks up the environment.
    ///
    /// # Errors
    /// The environment holds no number, several, or one out of range.
    pub fn shard(self, variable: impl Fn(&str) -> Option<String>) -> Result<Shard, Failure> {
        let count = match self {
            Self::Given(shard) => return Ok(shard),
            Self::Auto(count) => count,
        };
        let told = VARIABLES.iter().filter_map(|Variable { name, first }| {
            let number = variable(name)?.trim().parse::<usize>().ok()?;
            Some((*name, *first, number))
        });
        let told: Vec<_> = told.collect();
        let Some(&(name, first, number)) = told.first() else {
            let names: Vec<_> = VARIABLES.iter().map(|variable| variable.name).collect();
            let names = names.join(", ");
            return Err(format!(
                "--shard auto/{count}: no scheduler tells a number ({names}); give it: --shard 0/{count}"
            )
            .into());
        };
        if let Some((other, ..)) =
            told.iter().find(|(_, other, own)| own.checked_sub(*other) != number.checked_sub(first))
        {
            return Err(format!(
                "--shard auto/{count}: {name} and {other} tell different numbers; give the one that counts: --shard \
                 ${name}/{count}"
            )
            .into());
        }
        let index = number.checked_sub(first).filter(|index| *index < count);
        index.map(|index| Shard { index, count }).ok_or_else(|| {
            let last = first + count - 1;
            format!(
                "--shard auto/{count}: {name} is {number}, not from {first} to {last}; submit an array {first}-{last}"
            )
            .into()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_environment_of_each_scheduler_tells_the_shard() {
        for Variable { name, first } in &VARIABLES {
            let told = |asked: &str| (asked == *name).then(|| (first + 7).to_string());
            let shard = "auto/64".parse::<ShardChoice>().unwrap().shard(told).unwrap();
            assert_eq!(shard, Shard { index: 7, count: 64 }, "{name}");
            let beyond = ShardChoice::Auto(7).shard(told).unwrap_err().to_string();
            assert!(beyond.contains(&format!("{name} is {}", first + 7)) && beyond.contains("array"), "{beyond}");
        }
        let none = ShardChoice::Auto(4).shard(|_| None).unwrap_err().to_string();
        assert!(none.contains("SLURM_ARRAY_TASK_ID") && none.contains("--shard 0/4"), "{none}");
        // A job of Grid Engine that is no array; and an array that was submitted again for some tasks keeps their
        // numbers.
        assert!(ShardChoice::Auto(4).shard(|name| (name == "SGE_TASK_ID").then(|| "undefined".into())).is_err());
        assert_eq!("3/8".parse::<ShardChoice>().unwrap().shard(|_| None).unwrap(), Shard { index: 3, count: 8 });
        assert!("auto/0".parse::<ShardChoice>().is_err() && "auto".parse::<ShardChoice>().is_err());
    }

    #[test]
    fn schedulers_within_schedulers_are_no_guesswork() {
        let both = |hq: &'static str| {
            move |name: &str| match name {
                "SLURM_ARRAY_TASK_ID" => Some("2".to_owned()),
                "HQ_TASK_ID" => Some(hq.to_owned()),
                _ => None,
            }
        };
        assert_eq!(ShardChoice::Auto(4).shard(both("2")).unwrap().index, 2);
        let refused = ShardChoice::Auto(4).shard(both("3")).unwrap_err().to_string();
        assert!(refused.contains("HQ_TASK_ID") && refused.contains("SLURM_ARRAY_TASK_ID"), "{refused}");
    }
}

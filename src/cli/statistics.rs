//! Statistics that can be asked for, as options: one for each row of the table that has its own.

use clap::builder::PossibleValue;
use clap::{Arg, ArgAction, ArgMatches, Command, FromArgMatches};
use fluxion::film::{Asker, Needs, RECORDED, RecordedInfo};

/// An option `--NAME` for every statistic that whoever saves layers may ask for.
#[derive(Clone, Copy, Debug)]
pub struct Args(pub Needs);

/// Rows of statistics that are asked for by options.
fn rows() -> impl Iterator<Item = &'static RecordedInfo> {
    RECORDED.iter().filter(|row| row.asker == Asker::Option)
}

/// Names of all statistics that a set of data may have, as values of options.
pub fn names() -> impl Iterator<Item = PossibleValue> {
    let rows = RECORDED.iter().filter(|row| !matches!(row.asker, Asker::Film(..)));
    rows.map(|row| PossibleValue::new(row.name).help(row.help))
}

impl clap::Args for Args {
    fn augment_args(command: Command) -> Command {
        rows().fold(command, |command, row| {
            let help = format!("Record in the layers or in the checkpoint: {}", row.help);
            command.arg(Arg::new(row.name).long(row.name).help(help).action(ArgAction::SetTrue).requires("recorded"))
        })
    }

    fn augment_args_for_update(command: Command) -> Command {
        Self::augment_args(command)
    }
}

impl FromArgMatches for Args {
    fn from_arg_matches(matches: &ArgMatches) -> Result<Self, clap::Error> {
        Ok(Self(rows().fold(Needs::NONE, |needs, row| needs.with_if(row.id, matches.get_flag(row.name)))))
    }

    fn update_from_arg_matches(&mut self, matches: &ArgMatches) -> Result<(), clap::Error> {
        *self = Self::from_arg_matches(matches)?;
        Ok(())
    }
}

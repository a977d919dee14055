//! `egomotion study`: the paper's laboratory. Any [`egomotion_study::Study`] becomes files and one page.

mod laboratory;
mod real;
mod table;
#[cfg(test)]
mod tests;

use anyhow::Result;
use egomotion::estimate::RigPrior;
use egomotion::pipeline::Observe;
use egomotion_study::consistency::{DepthKind, RenderedSensor};
use egomotion_study::synthetic::MeasurementModel;
use egomotion_study::{
    Assumptions, Consistency, Efficiency, LabStudy, OneSetting, PoseConsistency, Reliability, Sensitivity,
    Uncertainty,
};

use crate::args::study::{
    ConsistencyArgs, EfficiencyArgs, LaboratoryArgs, PairSensorArg, ReliabilityArgs, RigArg, StudyCommand,
    TableArgs,
};
use crate::exit::Ending;
use crate::process::set_threads;
use crate::terminal::{command_line, stop_signal};

use laboratory::{Laboratory, LaboratoryOptions};

/// Run what was asked for.
pub fn study(command: &StudyCommand) -> Result<Ending> {
    match command {
        StudyCommand::Table(args) => alone(&args.laboratory, &one_setting(args)),
        StudyCommand::Sensitivity(args) => {
            alone(&args.laboratory, &sensitivity(&args.laboratory, args.sequences()))
        }
        StudyCommand::Uncertainty(args) => alone(args, &uncertainty(args)),
        StudyCommand::Real(args) => match real::recording(args)? {
            Some(recording) => alone(&args.laboratory, &recording),
            None => alone(&args.laboratory, &real::rendered(args)),
        },
        StudyCommand::Assumptions(args) => alone(args, &Assumptions { seed: args.seed }),
        StudyCommand::Consistency(args) => match args.rig {
            Some(rig) => alone(&args.laboratory, &poses(args, rig)),
            None => alone(&args.laboratory, &consistency(args)),
        },
        StudyCommand::Efficiency(args) => alone(&args.laboratory, &efficiency(args)),
        StudyCommand::Reliability(args) => alone(&args.laboratory, &reliability(args)),
        StudyCommand::All(args) => {
            let mut laboratory = open(args, None, Some("The paper's studies, repeated"))?;
            // Its draws are of another kind and number.
            laboratory.run(&uncertainty(&LaboratoryArgs { draws: None, ..args.clone() }))?;
            laboratory.run(&sensitivity(args, Sensitivity::default().sequences))?;
            // As many textures as it has by itself.
            laboratory.run(&LabStudy { first_seed: args.seed, ..LabStudy::default() })?;
            laboratory.run(&Assumptions { seed: args.seed })?;
            laboratory.run(&Efficiency { seed: args.seed, ..Efficiency::default() })?;
            laboratory.close()
        }
    }
}

fn one_setting(args: &TableArgs) -> OneSetting {
    OneSetting {
        sequence: args.sequence.clone(),
        step: args.step,
        model: MeasurementModel {
            round: args.round.0,
            std_disp_px: args.std,
            std_vel_px: args.std,
            std_track_px: args.std,
            features: args.features,
        },
        draws: args.laboratory.draws.unwrap_or(OneSetting::default().draws),
        seed: args.laboratory.seed,
    }
}

fn sensitivity(args: &LaboratoryArgs, sequences: Vec<String>) -> Sensitivity {
    let own = Sensitivity::default();
    Sensitivity { sequences, draws: args.draws.unwrap_or(own.draws), seed: args.seed }
}

fn uncertainty(args: &LaboratoryArgs) -> Uncertainty {
    let own = Uncertainty::default();
    Uncertainty { draws: args.draws.unwrap_or(own.draws), seed: args.seed, ..own }
}

fn poses(args: &ConsistencyArgs, rig: RigArg) -> PoseConsistency {
    let own = PoseConsistency::default();
    PoseConsistency {
        sequences: args.sequences.clone().unwrap_or(own.sequences),
        width_px: args.size.0,
        height_px: args.size.1,
        observe: if args.sparse { Observe::Sparse } else { Observe::Dense },
        runs: args.laboratory.draws.unwrap_or(own.runs),
        rig: match rig {
            RigArg::Erring => PoseConsistency::erring_rig(),
            RigArg::Exact => RigPrior::exact(),
        },
        seed: args.laboratory.seed,
        ..own
    }
}

fn consistency(args: &ConsistencyArgs) -> Consistency {
    let own = Consistency::default();
    Consistency {
        sequences: args.sequences.clone().unwrap_or(own.sequences),
        width_px: args.size.0,
        height_px: args.size.1,
        sensor: match args.sensor {
            PairSensorArg::Stereo => RenderedSensor::Stereo,
            PairSensorArg::Kinect => RenderedSensor::Depth(DepthKind::Kinect),
            PairSensorArg::TimeOfFlight => RenderedSensor::Depth(DepthKind::TimeOfFlight),
            PairSensorArg::Rendered => RenderedSensor::Depth(DepthKind::Rendered),
        },
        observe: if args.sparse { Observe::Sparse } else { Observe::Dense },
        pairs: args.laboratory.draws.unwrap_or(own.pairs),
        seed: args.laboratory.seed,
    }
}

fn reliability(args: &ReliabilityArgs) -> Reliability {
    let own = Reliability::default();
    Reliability {
        sequences: args.sequences.clone().unwrap_or(own.sequences),
        width_px: args.size.0,
        height_px: args.size.1,
        pairs: args.laboratory.draws.unwrap_or(own.pairs),
        seed: args.laboratory.seed,
    }
}

fn efficiency(args: &EfficiencyArgs) -> Efficiency {
    let own = Efficiency::default();
    Efficiency {
        sequences: args.sequences.clone().unwrap_or(own.sequences),
        methods: args.methods().unwrap_or(own.methods),
        draws: args.laboratory.draws.unwrap_or(own.draws),
        seed: args.laboratory.seed,
    }
}

/// Run one study into its folder.
fn alone<S: egomotion_study::Study>(args: &LaboratoryArgs, study: &S) -> Result<Ending> {
    let mut laboratory = open(args, Some(study.name()), None)?;
    laboratory.run(study)?;
    laboratory.close()
}

/// The laboratory of one study, or of all with a headline of their page.
fn open(args: &LaboratoryArgs, study: Option<&str>, title: Option<&str>) -> Result<Laboratory> {
    set_threads(args.threads)?;
    let options = LaboratoryOptions {
        resume: args.resume,
        quiet: args.quiet,
        title: title.map(str::to_owned),
        command: command_line(),
    };
    Laboratory::open(&args.folder(study), options, stop_signal("part"))
}

//! Arguments of `eval` and `pareto` for data sets, networks and trainings.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use clap::Arg;
use meissner_evaluate::trainings::Request;
use meissner_models::DEFAULT_NETWORK;
use meissner_run::model::WeightsFile;

use crate::args::{MapArgs, NETWORK, choice};

/// Digits with networks over events.
#[derive(Debug, clap::Args)]
pub(crate) struct DigitsTask {
    /// Folder of the data set, with folders train and test.
    ///
    /// One of the two is enough. Recordings are files such as train/3/00123.bin.
    #[arg(value_name = "DATA")]
    pub(crate) data: PathBuf,
    #[command(flatten)]
    pub(crate) networks: EventNetworks,
}

/// A set of recordings of touch.
#[derive(Debug, clap::Args)]
pub(crate) struct TouchData {
    /// Set of recordings.
    #[arg(value_name = "SET", value_parser = choice(SETS))]
    pub(crate) set: TouchSet,
    /// Folder of the data set, with the archive of the set, or the path of the archive.
    ///
    /// The archives are Ev-Objects.zip, Ev-Containers.zip and letters.npz.
    #[arg(value_name = "DATA")]
    pub(crate) data: PathBuf,
}

/// The set of touched things.
#[derive(Clone, Copy, Debug)]
pub(crate) enum TouchSet {
    Objects,
    Containers,
    Letters,
}

/// The names of the sets, with their help.
const SETS: &[(&str, &str, TouchSet)] = &[
    ("objects", "36 objects, grasped and held (NeuTouch)", TouchSet::Objects),
    ("containers", "4 containers with 5 fillings each, grasped and lifted (NeuTouch)", TouchSet::Containers),
    ("letters", "26 letters of braille and a blank, pressed (NUSkin)", TouchSet::Letters),
];

/// A set of recordings of touch, and networks over events.
#[derive(Debug, clap::Args)]
pub(crate) struct TouchTask {
    #[command(flatten)]
    pub(crate) data: TouchData,
    #[command(flatten)]
    pub(crate) networks: EventNetworks,
}

/// Networks of a task, with trainings.
#[derive(Debug, clap::Args)]
pub(crate) struct Networks {
    /// Network [default: every shipped network for the task].
    ///
    /// The name of a shipped network, or a description file, which needs weights or trainings. It
    /// may be given several times. With --trainings, the default is every shipped network with
    /// trainings in the folder.
    #[arg(long = "network", value_name = "NETWORK", help_heading = NETWORK)]
    networks: Vec<String>,
    /// Folder of safetensors files, each a training of a network.
    ///
    /// The long help of `meissner eval` for the task explains their metadata. Without this option,
    /// the shipped weights are used.
    #[arg(long, value_name = "DIR", help_heading = NETWORK)]
    trainings: Option<PathBuf>,
}

/// Networks of a task, with weights or trainings.
#[derive(Debug, clap::Args)]
pub(crate) struct TrainedNetworks {
    #[command(flatten)]
    networks: Networks,
    /// Weights of the only network [default: those shipped with it].
    ///
    /// The file is safetensors, or a state dict that PyTorch saved. For digits and touch, the
    /// weights must be trained on the split train.
    #[arg(long, value_name = "FILE", conflicts_with = "trainings", help_heading = NETWORK)]
    weights: Option<PathBuf>,
    #[command(flatten)]
    map: MapArgs,
}

/// Networks over events, with weights, trainings or the folds of a cross-validation.
#[derive(Debug, clap::Args)]
pub(crate) struct EventNetworks {
    #[command(flatten)]
    trained: TrainedNetworks,
    /// Number of folds of the cross-validation in --trainings.
    ///
    /// The folds must be those that `meissner prepare` writes for the task with --folds N.
    #[arg(long, value_name = "N", requires = "trainings", value_parser = clap::value_parser!(u32).range(2..),
          help_heading = NETWORK)]
    folds: Option<u32>,
}

/// Direction of slip with frame networks.
#[derive(Debug, clap::Args)]
pub(crate) struct SlipTask {
    /// Folder of the data set, with a folder for each class.
    ///
    /// The classes are aw (anticlockwise), cw (clockwise), e, n, s, w (directions) and t (touch
    /// without slip). Recordings are files such as n/pen178.csv.
    #[arg(value_name = "DATA")]
    pub(crate) data: PathBuf,
    #[command(flatten)]
    networks: Networks,
}

/// Quantities of presses.
#[derive(Debug, clap::Args)]
#[command(mut_arg("networks", of_presses))]
pub(crate) struct PressTask {
    /// Presses with labels along time (safetensors), such as `simulate markers` writes.
    #[arg(value_name = "EVENTS")]
    pub(crate) events: PathBuf,
    #[command(flatten)]
    networks: TrainedNetworks,
}

/// `--network` for presses.
fn of_presses(arg: Arg) -> Arg {
    let help = "Network: the name of a shipped network, or a description file";
    let more = "A description file needs --weights or --trainings. The option may be given several times.";
    arg.default_value(DEFAULT_NETWORK).help(help).long_help(format!("{help}.\n\n{more}"))
}

/// Forces of grasps.
#[derive(Debug, clap::Args)]
pub(crate) struct ForceTask {
    /// Recordings with their force (safetensors), such as `simulate grasp` writes.
    #[arg(value_name = "EVENTS")]
    pub(crate) events: PathBuf,
    #[command(flatten)]
    pub(crate) networks: TrainedNetworks,
}

/// Contact area and normal force from pictures.
#[derive(Debug, clap::Args)]
pub(crate) struct AreaTask {
    /// Files of pictures with labels.
    ///
    /// A file is one that `simulate gel` writes, or an archive (.npz) of real pictures of balls.
    #[arg(value_name = "PICTURES", required = true)]
    pub(crate) data: Vec<PathBuf>,
    #[command(flatten)]
    pub(crate) networks: TrainedNetworks,
}

impl Networks {
    fn request<'a>(&'a self, weights: Option<WeightsFile<'a>>) -> Request<'a> {
        Request { networks: &self.networks, weights, trainings: self.trainings.as_deref() }
    }
}

impl TrainedNetworks {
    pub(crate) fn request(&self) -> Request<'_> {
        self.networks.request(self.map.of(self.weights.as_deref()))
    }
}

impl EventNetworks {
    pub(crate) fn request(&self) -> Request<'_> {
        self.trained.request()
    }

    pub(crate) fn folds(&self) -> Option<usize> {
        self.folds.map(|folds| folds as usize)
    }
}

impl SlipTask {
    pub(crate) fn request(&self) -> Request<'_> {
        self.networks.request(None)
    }
}

impl PressTask {
    pub(crate) fn request(&self) -> Request<'_> {
        self.networks.request()
    }
}

//! The picture of `pareto --svg`: every setting as a point of run time against error.
//!
//! Settings on the front and exact ones have labels, others a tooltip.

use meissner_plot::{Errors, Panel, Setting, TradeOff, page};
use meissner_run::text::grouped;

use crate::text::file_name;
use meissner_evaluate::pareto::{Compared, EXACT, Report, SettingReport};

/// The picture, as the text of a file.
pub(crate) fn svg(report: &Report) -> String {
    let about = format!(
        "{}: {} {}s, {} timed, {} repeats by turns with the exact network, one thread, {} kernels",
        file_name(&report.data.name),
        grouped(report.data.size),
        report.unit,
        grouped(report.data.timed),
        report.repeats,
        report.isa
    );
    let (errors, has_interval) = match report.compared {
        Compared::Task(kind) if kind.is_share() => (Errors::Percentages, true),
        Compared::Task(_) => (Errors::Quantities, true),
        Compared::RelativeRms => (Errors::Differences, false),
    };
    let tasks = report.networks.iter().flat_map(|network| &network.exact().measurement.task);
    let of = tasks.map(|task| task.of.as_str()).next().unwrap_or_default();
    let settings = |network: usize| {
        report.networks[network].settings.iter().map(move |setting| point(report, network, setting))
    };
    let trade_off = TradeOff {
        time_title: report.time_name(),
        error_title: report.error_name().to_owned(),
        about: if has_interval {
            format!("{of}; bars: 95 % interval")
        } else {
            "against the exact outputs, as a share of their RMS".to_owned()
        },
        errors,
        networks: report.networks.iter().map(|network| network.network.clone()).collect(),
        points: (0..report.networks.len()).flat_map(settings).collect(),
    };
    page(&format!("Run time against error: {}", report.system), &about, &[vec![Panel::TradeOff(trade_off)]])
}

fn point(report: &Report, network: usize, setting: &SettingReport) -> Setting {
    let name = &report.networks[network].network;
    let error = setting.error_text(report.compared);
    let of_network = if report.networks.len() > 1 { format!("{name}, ") } else { String::new() };
    let (figure, shown): (String, Box<dyn Fn(f64) -> f64>) = match report.compared {
        Compared::Task(kind) => {
            (format!(", {error} {}", kind.unit()), Box::new(move |error| kind.shown(error)))
        }
        Compared::RelativeRms => (String::new(), Box::new(|error| error)),
    };
    let is_named = setting.on_front || setting.setting == EXACT;
    Setting {
        network,
        time: setting.us,
        error: shown(setting.error),
        interval: setting.interval_95.map(|(low, high)| (shown(low), shown(high))),
        on_front: setting.on_front,
        label: is_named.then(|| format!("{of_network}{}{figure}", setting.setting)),
        tooltip: format!(
            "{name}, {}: {} {}, {:.2} times as fast, {} {error}",
            setting.setting,
            report.time_name(),
            setting.time_text(),
            setting.speed_up,
            report.error_name()
        ),
    }
}

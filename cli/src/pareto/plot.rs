//! The picture of `pareto --svg`: every setting as a point of run time against error.
//!
//! Settings on the front and exact settings have labels. Others have their name and figures as a tooltip.

#[cfg(test)]
mod tests;

use meissner_pipeline::text::grouped;
use meissner_plot::{Panel, Setting, TradeOff, page};

use crate::text::file_name;
use meissner_evaluate::pareto::{Compared, EXACT, Report, SettingReport};

/// The picture, as the text of a file.
pub(super) fn svg(report: &Report) -> String {
    let about = format!(
        "{}: {} {}s, {} timed, {} repeats by turns with the exact network, one thread, {} kernels",
        file_name(&report.data.name),
        grouped(report.data.size),
        report.unit,
        grouped(report.data.timed),
        report.repeats,
        report.isa
    );
    let percent = report.compared == Compared::TaskError;
    let tasks = report.networks.iter().flat_map(|network| &network.exact().measurement.task);
    let of = tasks.map(|task| task.of.as_str()).next().unwrap_or_default();
    let settings = |network: usize| {
        report.networks[network].settings.iter().map(move |setting| point(report, network, setting))
    };
    let trade_off = TradeOff {
        time_title: report.time_name(),
        error_title: report.error_name().to_owned(),
        about: if percent {
            format!("{of}; bars: 95 % interval")
        } else {
            "against the exact outputs, as a share of their RMS".to_owned()
        },
        percent,
        networks: report.networks.iter().map(|network| network.network.clone()).collect(),
        points: (0..report.networks.len()).flat_map(settings).collect(),
    };
    page(&format!("Run time against error: {}", report.system), &about, &[vec![Panel::TradeOff(trade_off)]])
}

fn point(report: &Report, network: usize, setting: &SettingReport) -> Setting {
    let name = &report.networks[network].network;
    let error = setting.error_text(report.compared);
    let of_network = if report.networks.len() > 1 { format!("{name}, ") } else { String::new() };
    let figure = setting.interval_95.map_or_else(String::new, |_| format!(", {error} %"));
    let is_named = setting.on_front || setting.setting == EXACT;
    // Shares of wrong answers are shown in percent.
    let unit = if report.compared == Compared::TaskError { 100.0 } else { 1.0 };
    Setting {
        network,
        time: setting.us,
        error: unit * setting.error,
        interval: setting.interval_95.map(|(low, high)| (unit * low, unit * high)),
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

//! What the figures come to: for each network the fastest setting that costs little.

use super::measurement::EXACT;
use super::report::{Compared, Fastest, NetworkReport, SettingReport};
use crate::text::percent;

/// How much more error is little: shares of wrong answers, or of the outputs' RMS.
fn bounds(compared: Compared) -> [f64; 3] {
    match compared {
        Compared::TaskError => [0.005, 0.01, 0.02],
        Compared::RelativeRms => [1e-3, 1e-2, 1e-1],
    }
}

/// What is less than this times as fast as the exact network is no faster: clocks do not tell it.
const NOTICEABLE: f64 = 1.02;

/// The fastest setting of each network within each bound of its exact error, the exact one included; of equally fast ones
/// the first.
pub(super) fn fastest(networks: &[NetworkReport], compared: Compared) -> Vec<Fastest> {
    let mut all = Vec::new();
    for network in networks {
        for within in bounds(compared) {
            // Differences of shares such as 0.11 - 0.1 exceed 0.01 in the last bit.
            let most = network.exact().error + within + 1e-12;
            let faster = |setting: &SettingReport| setting.setting == EXACT || setting.speed_up >= NOTICEABLE;
            let fits = network.settings.iter().filter(|setting| setting.error <= most && faster(setting));
            let fastest = fits.reduce(|best, other| if other.us < best.us { other } else { best });
            all.extend(fastest.map(|fastest| Fastest {
                network: network.network.clone(),
                within,
                setting: fastest.setting.clone(),
                speed_up: fastest.speed_up,
                error: fastest.error,
            }));
        }
    }
    all
}

/// One paragraph.
pub(super) fn words(networks: &[NetworkReport], fastest: &[Fastest], compared: Compared) -> String {
    let sentence = |network: &NetworkReport| {
        let own = fastest.iter().filter(|fastest| fastest.network == network.network);
        let parts: Vec<String> = own.map(|fastest| part(fastest, network.exact(), compared)).collect();
        let exact = match compared {
            Compared::TaskError => {
                format!(
                    "{} is wrong in {} % of its answers when it is exact",
                    network.network,
                    percent(network.exact().error)
                )
            }
            Compared::RelativeRms => format!("{} against its exact outputs", network.network),
        };
        format!("{exact}: {}.", parts.join("; "))
    };
    networks.iter().map(sentence).collect::<Vec<_>>().join(" ")
}

fn part(fastest: &Fastest, exact: &SettingReport, compared: Compared) -> String {
    let within = match compared {
        Compared::TaskError => format!("within {} points", 100.0 * fastest.within),
        Compared::RelativeRms => format!("within {} of their RMS", fastest.within),
    };
    if fastest.setting == exact.setting {
        return format!("{within} nothing is faster");
    }
    let error = match compared {
        Compared::TaskError => format!("{} %", percent(fastest.error)),
        Compared::RelativeRms => format!("{:.1e}", fastest.error),
    };
    format!("{within} the fastest is {}, {:.2} times as fast ({error})", fastest.setting, fastest.speed_up)
}

#[cfg(test)]
mod tests {
    use super::{fastest, words};
    use crate::pareto::measurement::Measurement;
    use crate::pareto::report::{Compared, NetworkReport, SettingReport};

    fn setting(name: &str, speed_up: f64, error: f64) -> SettingReport {
        let measurement = Measurement::of_nothing(Vec::new());
        let (setting, us) = (name.to_owned(), 10.0 / speed_up);
        SettingReport { setting, us, speed_up, error, interval_95: None, on_front: false, measurement }
    }

    fn network() -> NetworkReport {
        let settings = vec![
            setting("exact", 1.0, 0.1),
            setting("as fast", 1.01, 0.1),
            setting("at the bound", 2.0, 0.11),
            setting("beyond", 3.0, 0.1301),
        ];
        let text = |text: &str| text.to_owned();
        NetworkReport { network: text("own"), weights: text("drawn"), fingerprint: text("0"), settings }
    }

    #[test]
    fn the_fastest_setting_is_one_whose_error_is_within_the_bound() {
        let networks = [network()];
        let fastest = fastest(&networks, Compared::TaskError);
        let names: Vec<&str> = fastest.iter().map(|fastest| fastest.setting.as_str()).collect();
        assert_eq!(names, ["exact", "at the bound", "at the bound"]);
        let words = words(&networks, &fastest, Compared::TaskError);
        assert!(words.starts_with("own is wrong in 10.00 % of its answers when it is exact:"), "{words}");
        assert!(words.contains("within 0.5 points nothing is faster; within 1 points"), "{words}");
        assert!(words.contains("the fastest is at the bound, 2.00 times as fast (11.00 %)"), "{words}");
    }
}

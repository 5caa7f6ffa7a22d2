//! The parts of pictures.

mod accuracy {
    use roxmltree::Document;

    use crate::Panel;
    use crate::accuracy::{AccuracyCurve, Curves, LINES, strength};

    #[test]
    fn lines_that_meet_are_all_visible_and_names_are_outside_the_field() {
        let curve = |(colour, name): (usize, &str)| AccuracyCurve {
            name: format!("{name}, 50.0 %"),
            colour,
            accuracy: vec![0.5; 2],
            interval: vec![(0.4, 0.6); 2],
        };
        let curves = Curves {
            title: "Accuracy".to_owned(),
            about: String::new(),
            time_title: "time (ms)".to_owned(),
            times: vec![1.0, 2.0],
            chance: 0.1,
            compact: false,
            curves: ["a", "b", "c"].into_iter().enumerate().map(curve).collect(),
        };
        let svg = crate::page("", "", &[vec![Panel::Curves(curves)]]);
        let document = Document::parse(&svg).expect("it is well-formed XML");
        let number = |text: Option<&str>| text.and_then(|text| text.parse::<f64>().ok()).expect("a number");
        let lines = document.descendants().filter(|node| node.has_tag_name("polyline"));
        let widths: Vec<f64> = lines.map(|line| number(line.attribute("stroke-width"))).collect();
        assert!(widths.len() == 3 && widths.windows(2).all(|two| two[0] > two[1] + 1.0), "{widths:?}");
        let names = document.descendants().filter(|node| {
            node.has_tag_name("text") && node.text().is_some_and(|text| text.ends_with(", 50.0 %"))
        });
        let heights: Vec<f64> = names.map(|name| number(name.attribute("y"))).collect();
        assert!(heights.len() == 3 && heights.iter().all(|&y| y < LINES.top), "{heights:?}");
    }

    #[test]
    fn numbers_can_be_read_on_every_shade() {
        assert_eq!([strength(0.0), strength(1.0), strength(2.0)], [0.0, 1.0, 1.0]);
        let linear =
            |level: f64| if level <= 0.04045 { level / 12.92 } else { ((level + 0.055) / 1.055).powf(2.4) };
        let luminance = |[r, g, b]: [f64; 3]| {
            0.2126 * linear(r / 255.0) + 0.7152 * linear(g / 255.0) + 0.0722 * linear(b / 255.0)
        };
        for share in (0..=100).map(|percent| f64::from(percent) / 100.0) {
            let over = |dark: f64| 255.0 + (dark - 255.0) * strength(share);
            let cell = luminance([0.0, 72.0, 128.0].map(over));
            let ink = luminance(if share < 0.5 { [34.0; 3] } else { [255.0; 3] });
            let contrast = (cell.max(ink) + 0.05) / (cell.min(ink) + 0.05);
            assert!(contrast >= 4.5, "{share}: {contrast}");
        }
    }
}

mod axes {
    use crate::axes::{Axis, decades, widened};

    fn labels(axis: &Axis) -> Vec<String> {
        axis.ticks().into_iter().filter_map(|tick| tick.label).collect()
    }

    #[test]
    fn an_axis_has_a_margin_at_both_ends_and_a_length_even_for_one_value() {
        assert_eq!(widened([1.0, 3.0].into_iter(), 0.5), (0.9, 3.1));
        assert_eq!(widened([2.0].into_iter(), 0.5), (1.75, 2.25));
        assert_eq!(widened(std::iter::empty(), 0.5), (0.0, 1.0));
        assert_eq!(decades([0.0, 20.0, 3000.0].into_iter(), (0.0, 3.0)), (1.0, 4.0));
        assert_eq!(decades([10.0].into_iter(), (0.0, 3.0)), (1.0, 2.0));
        assert_eq!(decades([0.0].into_iter(), (0.0, 3.0)), (0.0, 3.0));
    }

    #[test]
    fn ticks_of_a_linear_axis_are_round_and_few() {
        let labels = |low, high| labels(&Axis::linear((low, high), (0.0, 1.0))).join(" ");
        assert_eq!(labels(0.0, 310.0), "0 50 100 150 200 250 300");
        assert_eq!(labels(0.0, 160.0), "0 20 40 60 80 100 120 140 160");
        assert_eq!(labels(0.0, 0.1), "0.00 0.02 0.04 0.06 0.08 0.10");
        assert_eq!(labels(-2000.0, 1000.0), "-2,000 -1,500 -1,000 -500 0 500 1,000");
        assert_eq!(labels(2.3, 4.6), "2.5 3.0 3.5 4.0 4.5");
        assert_eq!(labels(0.0, 8388.608), "0 2,000 4,000 6,000 8,000");
    }

    #[test]
    fn ticks_of_a_logarithmic_axis_are_written_in_digits_where_they_are_short() {
        let labels = |low, high| labels(&Axis::logarithmic((low, high), (0.0, 1.0))).join(" ");
        assert_eq!(labels(-3.0, 4.0), "0.001 0.01 0.1 1 10 100 1,000 10,000");
        assert_eq!(labels(-0.5, 1.0), "0.5 0.7 1 2 3 5 7 10");
        assert_eq!(labels(-6.0, -2.0), "1e-6 1e-5 1e-4 0.001 0.01");
    }

    #[test]
    fn every_value_has_a_place_on_the_axis() {
        let axis = Axis::logarithmic((0.0, 3.0), (400.0, 100.0));
        assert_eq!(
            [10.0, 0.0, -1.0, 1e9, f64::INFINITY].map(|value| axis.place(value)),
            [300.0, 400.0, 400.0, 100.0, 100.0]
        );
        let with_zero = axis.with_zero();
        assert_eq!([0.0, 1.0, 1000.0].map(|value| with_zero.place(value)), [387.0, 374.0, 100.0]);
    }
}

mod labels {
    use proptest::prelude::*;

    use crate::labels::place;
    use crate::svg::Area;

    const FIELD: Area = Area { left: 0.0, top: 0.0, right: 900.0, bottom: 500.0 };

    #[test]
    fn a_label_alone_is_to_the_right_of_its_point() {
        let placed = place(&[((100.0, 100.0), 60.0)], &[], &FIELD);
        let area = placed[0].expect("there is room");
        assert!(area.left > 100.0 && area.top < 100.0 && area.bottom > 100.0, "{area:?}");
    }

    #[test]
    fn a_label_at_the_border_stays_inside() {
        let placed = place(&[((899.0, 499.0), 60.0)], &[], &FIELD);
        assert!(placed[0].is_some_and(|area| area.right <= 900.0 && area.bottom <= 500.0));
    }

    #[test]
    fn where_there_is_no_room_there_is_no_label() {
        let narrow = Area { right: 50.0, ..FIELD };
        assert_eq!(place(&[((10.0, 10.0), 60.0)], &[], &narrow), [None]);
    }

    proptest! {
        #[test]
        fn no_label_covers_another(
            points in proptest::collection::vec(((0.0..900.0, 0.0..500.0), 30.0..200.0), 1..20)
        ) {
            let obstacles: Vec<Area> = points.iter().map(|&(point, _)| Area::spanning(point, point, 5.0)).collect();
            let placed = place(&points, &obstacles, &FIELD);
            for (i, a) in placed.iter().enumerate() {
                let Some(a) = a else { continue };
                prop_assert!(FIELD.contains((a.left, a.top)) && FIELD.contains((a.right, a.bottom)));
                for b in placed[..i].iter().flatten().chain(&obstacles) {
                    prop_assert!(!a.overlaps(b), "{:?} {:?}", a, b);
                }
            }
        }
    }
}

mod plane {
    use roxmltree::Document;

    use crate::plane::{Plane, SIZE, Scale, Series, Style};
    use crate::{Panel, figure};

    fn page(series: Vec<Series>) -> String {
        let [title, about, x_title, y_title] = ["a", "b", "x", "y"].map(str::to_owned);
        crate::page(
            "",
            "",
            &[vec![Panel::Plane(Plane {
                title,
                about,
                x_title,
                y_title,
                scale: Scale::FromZero,
                compact: false,
                ordered: false,
                series,
            })]],
        )
    }

    #[test]
    fn lines_and_dots_lie_in_the_field_and_points_without_a_value_are_left_out() {
        let of = |style, points: &[(f64, f64)]| Series {
            name: "n".to_owned(),
            colour: 0,
            style,
            points: points.to_vec(),
        };
        let dots = of(Style::Dots, &[(0.0, 1.0), (1.0, 3.0), (f64::NAN, 1.0)]);
        let svg = page(vec![of(Style::Dashed, &[(0.0, 1.0), (2.0, 2.0)]), dots]);
        let document = Document::parse(&svg).expect("it is well-formed XML");
        let number = |text: Option<&str>| text.and_then(|text| text.parse::<f64>().ok()).expect("a number");
        let circles: Vec<_> = document.descendants().filter(|node| node.has_tag_name("circle")).collect();
        // The larger one is in the legend.
        let circles: Vec<_> = circles.into_iter().filter(|node| node.attribute("r") == Some("1.8")).collect();
        assert_eq!(circles.len(), 2);
        for circle in circles {
            let (x, y) = (number(circle.attribute("cx")), number(circle.attribute("cy")));
            assert!((66.0..=66.0 + SIZE.0).contains(&x) && (66.0..=66.0 + SIZE.1).contains(&y));
        }
        let line =
            document.descendants().find(|node| node.has_tag_name("polyline")).expect("there is a line");
        assert!(line.attribute("stroke-dasharray").is_some());
        // An empty picture is an empty field.
        assert!(Document::parse(&page(Vec::new())).is_ok());
    }

    #[test]
    fn a_power_is_a_straight_line_between_logarithmic_axes() {
        let points = vec![(10.0, 3.0), (100.0, 12.0), (1000.0, 48.0), (0.0, 1.0)];
        let mut plane = Plane::new("", ["x", "y"]);
        plane.scale = Scale::Logarithmic;
        plane.series.push(Series::new("", 0, Style::Marks, points));
        let (svg, _) = figure("power", &Panel::Plane(plane));
        let document = Document::parse(&svg).expect("it is well-formed XML");
        let circles = document.descendants().filter(|node| node.has_tag_name("circle"));
        let number = |text: Option<&str>| text.and_then(|text| text.parse::<f64>().ok()).expect("a number");
        let places: Vec<_> =
            circles.map(|node| (number(node.attribute("cx")), number(node.attribute("cy")))).collect();
        let step = |i: usize| (places[i + 1].0 - places[i].0, places[i + 1].1 - places[i].1);
        assert!(step(0).0 > 50.0 && step(0).1 < -50.0, "{places:?}");
        assert!((step(0).0 - step(1).0).abs() < 0.2 && (step(0).1 - step(1).1).abs() < 0.2, "{places:?}");
        // Values without a logarithm are at the end.
        assert!((places[3].0 - 66.0).abs() < 1e-6, "{places:?}");
    }

    #[test]
    fn predicted_over_true_values_have_a_line_from_the_least_truth_to_the_greatest() {
        let dots = |points: Vec<(f64, f64)>| vec![Series::new("a", 0, Style::Dots, points)];
        let plane = Plane::predicted("force", "N", dots(vec![(2.0, 9.0), (1.0, -3.0), (f64::NAN, 0.0)]));
        assert_eq!((&*plane.x_title, &*plane.y_title), ("true (N)", "predicted (N)"));
        assert_eq!(plane.series[0].points, [(1.0, 1.0), (2.0, 2.0)]);
        let (svg, _) = figure("dots", &Panel::Plane(plane));
        assert_eq!((svg.matches("<polyline").count(), svg.matches("fill-opacity").count()), (1, 2), "{svg}");
        let empty = Plane::predicted("force", "N", dots(Vec::new()));
        assert!(empty.series[0].points.is_empty());
        figure("nothing", &Panel::Plane(empty));
    }
}

mod svg {
    use crate::svg::{Svg, escaped};

    #[test]
    fn names_cannot_break_a_picture() {
        assert_eq!(escaped("a<b>&\"c\"\u{1}\u{ffff}"), "a&lt;b&gt;&amp;&quot;c&quot;");
    }

    #[test]
    fn numbers_have_at_most_one_decimal_and_no_negative_zero() {
        let mut svg = Svg::default();
        svg.line((-0.04, 1.0), (1.26, 2.5), "#000000").dashes("").dashes("2 3");
        let line =
            "<line x1=\"0\" y1=\"1\" x2=\"1.3\" y2=\"2.5\" stroke=\"#000000\" stroke-dasharray=\"2 3\"/>\n";
        assert_eq!(svg.to_string(), line);
    }
}

mod text {
    use crate::text::{grouped, percent, width, wrapped};

    #[test]
    fn lines_are_as_wide_as_their_room_and_words_stay_whole() {
        let lines = wrapped("aa bb cc\ndddddddd e", 30.0, |line| width(line, 10.0));
        assert_eq!(lines, ["aa bb", "cc", "dddddddd", "e"]);
        assert!(wrapped("", 30.0, |line| width(line, 10.0)).is_empty());
    }

    #[test]
    fn thousands_have_a_comma_between_them() {
        assert_eq!(
            [0, 999, 1000, 221_216, 1_234_567].map(grouped).join(" "),
            "0 999 1,000 221,216 1,234,567"
        );
    }

    #[test]
    fn percentages_have_two_decimals_and_what_is_not_0_is_not_shown_as_0() {
        let shown = [0.0, -0.0, 0.00004, 0.0001, 0.1234, 1.0, 1.5, -0.25, -0.000_001].map(percent);
        assert_eq!(shown, ["0.00", "0.00", "<0.01", "0.01", "12.34", "100.00", "150.00", "-25.00", "0.00"]);
        assert_eq!(percent(f64::NAN), "NaN");
    }
}

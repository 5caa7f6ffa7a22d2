//! Truth between its rows.

use crate::Truth;

#[test]
fn truth_is_linear_between_rows_and_unknown_outside() {
    let names = vec!["a".to_owned()];
    let truth = Truth { names, rows: vec![(10, vec![1.0]), (20, vec![3.0]), (30, vec![f64::NAN])] };
    assert_eq!([truth.at(0, 10), truth.at(0, 15)], [1.0, 2.0]);
    for t_us in [9, 21, 30, 31] {
        assert!(truth.at(0, t_us).is_nan(), "{t_us}");
    }
    assert!(truth.at(1, 15).is_nan() && Truth::default().at(0, 0).is_nan());
}

//! How far a map of contacts or forces is from the true one.

use super::error::{ContactError, same_length, setting};

/// Intersection over union of two masks; 1 where neither has a contact, since they agree.
///
/// # Errors
/// [`ContactError::Length`] where the masks differ in length.
pub fn iou(found: &[bool], truth: &[bool]) -> Result<f64, ContactError> {
    same_length("mask", truth.len(), found.len())?;
    let (mut both, mut either) = (0_usize, 0_usize);
    for (&a, &b) in found.iter().zip(truth) {
        both += usize::from(a & b);
        either += usize::from(a | b);
    }
    Ok(if either == 0 { 1.0 } else { both as f64 / either as f64 })
}

/// Mean absolute error of a map of forces, in its unit; summed in f64 in row-major order.
///
/// # Errors
/// [`ContactError::Length`] where the maps differ in length, [`ContactError::Setting`] where they are empty.
pub fn force_mae(found: &[f32], truth: &[f32]) -> Result<f64, ContactError> {
    same_length("map of forces", truth.len(), found.len())?;
    setting("pixels of a map of forces", "at least 1", 0.0, !truth.is_empty())?;
    let sum: f64 = found.iter().zip(truth).map(|(&a, &b)| (f64::from(a) - f64::from(b)).abs()).sum();
    Ok(sum / truth.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::{force_mae, iou};

    #[test]
    fn the_iou_counts_common_pixels_over_all() {
        assert_eq!(iou(&[true, true, false, false], &[true, false, true, false]).unwrap(), 1.0 / 3.0);
        assert_eq!(iou(&[true, false], &[true, false]).unwrap(), 1.0);
        assert_eq!(iou(&[true, false], &[false, true]).unwrap(), 0.0);
    }

    #[test]
    fn masks_without_a_contact_agree() {
        assert_eq!(iou(&[false; 3], &[false; 3]).unwrap(), 1.0);
        assert_eq!(iou(&[], &[]).unwrap(), 1.0);
    }

    #[test]
    fn the_mae_is_the_mean_of_the_differences() {
        assert_eq!(force_mae(&[1.0, 2.0, -3.0, 0.0], &[1.5, 1.0, -3.0, 0.5]).unwrap(), 0.5);
    }

    #[test]
    fn maps_of_different_lengths_and_empty_ones_are_refused() {
        let error = iou(&[true], &[true, true]).unwrap_err().to_string();
        assert_eq!(error, "mask: expected 2 values, found 1");
        assert!(force_mae(&[1.0], &[1.0, 2.0]).is_err());
        assert!(force_mae(&[], &[]).is_err());
    }
}

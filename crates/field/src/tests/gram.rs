//! Sums by pairs of parameters against the product of the rows themselves.

use faer::Mat;
use truearm_estimate::dense::product;
use truearm_kinematics::Cancel;

use super::posterior::sets;
use super::sets::long;
use crate::gram::add_gram;
use crate::model::Model;
use crate::unknowns::unknowns;
use crate::weight_rows::WeightRows;

#[test]
fn sums_by_pairs_are_the_product_of_the_rows() {
    for (training, joints) in sets() {
        let hyper = long(&training, joints);
        let model = Model::new(training, hyper, 2);
        let (unknowns, width) = unknowns(&model).unwrap();
        let rows = WeightRows::new(&model, &unknowns, width);
        let none = Cancel::default();
        let poses: Vec<usize> = (0..model.training.pose_count()).step_by(2).collect();
        let mut by_rows = Mat::<f64>::zeros(width, width);
        rows.each(&poses, &none, |batch| {
            by_rows += product(batch.rows, batch.rows.transpose());
            Ok(())
        })
        .unwrap();
        let mut by_pairs = Mat::<f64>::zeros(width, width);
        add_gram(&mut by_pairs, &rows, &poses, 1.0, &none).unwrap();
        let blocks = width - rows.first_of_all();
        assert!(blocks > width / 2 && blocks < width, "{blocks} of {width}");
        let largest = by_rows.norm_max();
        let lower = || (0..width).flat_map(|j| (j..width).map(move |i| (i, j)));
        assert!(lower().all(|at| (by_pairs[at] - by_rows[at]).abs() < 1e-12 * largest));
        add_gram(&mut by_pairs, &rows, &poses, -1.0, &none).unwrap();
        assert!(lower().all(|at| by_pairs[at].abs() < 1e-12 * largest));
    }
}

// SPDX-License-Identifier: MIT
#include "skeletex/geometry/best_rotation.h"

#include <Eigen/SVD>

namespace skeletex {

Eigen::Matrix3d best_rotation(const Eigen::Matrix3d& moment) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(moment, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double scale = svd.singularValues()[0];
  if (!(scale > 0)) return Eigen::Matrix3d::Identity();
  if (svd.singularValues()[1] < 1e-12 * scale)
    return Eigen::Quaterniond::FromTwoVectors(svd.matrixV().col(0), svd.matrixU().col(0)).toRotationMatrix();
  Eigen::Matrix3d flip = Eigen::Matrix3d::Identity();
  flip(2, 2) = (svd.matrixU() * svd.matrixV().transpose()).determinant() < 0 ? -1 : 1;
  return svd.matrixU() * flip * svd.matrixV().transpose();
}

Eigen::Quaterniond best_rotation(const std::vector<Vec3>& from, const std::vector<Vec3>& to) {
  Eigen::Matrix3d moment = Eigen::Matrix3d::Zero();
  for (std::size_t i = 0; i < from.size(); ++i) moment += to[i] * from[i].transpose();
  return Eigen::Quaterniond(best_rotation(moment));
}

}  // namespace skeletex

/// Distances between collision shapes through FCL.
#include <limits>

#include <fcl/fcl.h>
#include <fmt/format.h>
#include <Eigen/Geometry>

#include "heft/collision/collision.hpp"
#include "heft/host/error.hpp"
#include "heft/host/rotation.hpp"

namespace heft::collision {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using model::LinkShape;

struct Solid {
  int link{-1};
  std::string name;
  std::shared_ptr<fcl::CollisionGeometryd> geometry;
  Matrix3d rotation{Matrix3d::Identity()};  ///< in the link frame
  Vector3d position{Vector3d::Zero()};
};

std::shared_ptr<fcl::CollisionGeometryd> mesh_of(const LinkShape& shape) {
  if (shape.corners.empty() || shape.corners.size() % 3 != 0) {
    throw ModelError(fmt::format("link \"{}\": mesh: found {} corners; expected three for each triangle",
                                 shape.link_name, shape.corners.size()));
  }
  std::vector<Vector3d> points;
  std::vector<fcl::Triangle> triangles;
  for (const auto& corner : shape.corners) points.emplace_back(corner[0], corner[1], corner[2]);
  for (std::size_t t = 0; t + 2 < points.size(); t += 3) triangles.emplace_back(t, t + 1, t + 2);
  auto mesh = std::make_shared<fcl::BVHModel<fcl::OBBRSSd>>();
  mesh->beginModel();
  mesh->addSubModel(points, triangles);
  mesh->endModel();
  return mesh;
}

Solid solid_of(const LinkShape& shape) {
  Solid solid;
  solid.link = shape.link;
  solid.name = shape.link_name;
  solid.rotation = Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(shape.rotation.data());
  solid.position = Vector3d(shape.position[0], shape.position[1], shape.position[2]);
  switch (shape.kind) {
    case LinkShape::Kind::kBox:
      solid.geometry = std::make_shared<fcl::Boxd>(shape.size[0], shape.size[1], shape.size[2]);
      break;
    case LinkShape::Kind::kCylinder:
      solid.geometry = std::make_shared<fcl::Cylinderd>(shape.size[0], shape.size[1]);
      break;
    case LinkShape::Kind::kSphere: solid.geometry = std::make_shared<fcl::Sphered>(shape.size[0]); break;
    case LinkShape::Kind::kMesh: solid.geometry = mesh_of(shape); break;
  }
  return solid;
}

Solid solid_of(const Capsule& capsule) {
  Solid solid;
  solid.link = capsule.link;
  solid.name = capsule.name;
  const Vector3d d = capsule.b - capsule.a;
  solid.position = 0.5 * (capsule.a + capsule.b);
  if (d.norm() > 0.0) {
    solid.rotation = rotation_from_z(d);
    solid.geometry = std::make_shared<fcl::Capsuled>(capsule.radius, d.norm());
  } else {
    solid.geometry = std::make_shared<fcl::Sphered>(capsule.radius);
  }
  return solid;
}

}  // namespace

struct ShapeDistance::Impl {
  model::Robot robot;
  std::vector<Solid> solids;
  std::vector<std::pair<std::size_t, std::size_t>> pairs;

  fcl::Transform3d placement(const LinkFrames& frames, const Solid& solid) const {
    fcl::Transform3d T = fcl::Transform3d::Identity();
    T.linear() = solid.link < 0
                     ? solid.rotation
                     : Matrix3d(frames.rotation[static_cast<std::size_t>(solid.link)] * solid.rotation);
    T.translation() = frames.at(solid.link, solid.position);
    return T;
  }
};

ShapeDistance::ShapeDistance(const model::Robot& robot, const std::vector<LinkShape>& shapes,
                             const ArmCapsules& arm, const std::vector<BoxObstacle>& obstacles)
    : impl_(std::make_unique<Impl>()) {
  impl_->robot = robot;
  std::vector<Solid>& solids = impl_->solids;
  for (const LinkShape& shape : shapes) solids.push_back(solid_of(shape));
  // Solids of each capsule.
  std::vector<std::vector<std::size_t>> inside;
  for (const Capsule& capsule : arm.capsules) {
    inside.emplace_back(capsule.shapes.begin(), capsule.shapes.end());
    if (!capsule.shapes.empty()) continue;
    inside.back().push_back(solids.size());
    solids.push_back(solid_of(capsule));
  }
  for (const CapsulePair& pair : arm.pairs) {
    for (const std::size_t i : inside[static_cast<std::size_t>(pair.first)]) {
      for (const std::size_t j : inside[static_cast<std::size_t>(pair.second)])
        impl_->pairs.emplace_back(i, j);
    }
  }
  const std::size_t boxes = solids.size();
  for (const BoxObstacle& box : obstacles) {
    Solid solid;
    solid.name = box.name;
    const Vector3d size = box.upper - box.lower;
    solid.geometry = std::make_shared<fcl::Boxd>(size);
    solid.position = 0.5 * (box.lower + box.upper);
    solids.push_back(solid);
  }
  for (const GuardedObstacle& guarded : arm.guarded) {
    for (const std::size_t i : inside[static_cast<std::size_t>(guarded.capsule)])
      impl_->pairs.emplace_back(i, boxes + static_cast<std::size_t>(guarded.obstacle));
  }
}

ShapeDistance::~ShapeDistance() = default;
ShapeDistance::ShapeDistance(ShapeDistance&&) noexcept = default;
ShapeDistance& ShapeDistance::operator=(ShapeDistance&&) noexcept = default;

ShapeDistance::Result ShapeDistance::nearest(const Eigen::VectorXd& q) const {
  const LinkFrames frames(impl_->robot, q);
  std::vector<fcl::Transform3d, Eigen::aligned_allocator<fcl::Transform3d>> placements;
  for (const Solid& solid : impl_->solids) placements.push_back(impl_->placement(frames, solid));
  Result result{std::numeric_limits<double>::infinity(), "", ""};
  for (const auto& [i, j] : impl_->pairs) {
    fcl::DistanceRequestd request;
    fcl::DistanceResultd found;
    const Solid &first = impl_->solids[i], &second = impl_->solids[j];
    fcl::distance(first.geometry.get(), placements[i], second.geometry.get(), placements[j], request, found);
    const double distance = std::max(0.0, found.min_distance);
    if (distance < result.distance) result = {distance, first.name, second.name};
  }
  return result;
}

}  // namespace heft::collision

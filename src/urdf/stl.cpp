#include "stl.hpp"

#include <cmath>
#include <cstdint>
#include <cstring>
#include <sstream>

#include <fmt/format.h>

#include "heft/host/error.hpp"
#include "heft/host/file.hpp"

namespace heft::urdf {
namespace {

constexpr std::size_t kHeader = 84;    // 80 letters and the number of triangles
constexpr std::size_t kTriangle = 50;  // a normal and three corners of three floats each, two bytes more
constexpr std::size_t kMostTriangles = 1'000'000;

std::uint32_t triangles_stated(const std::string& text) {
  std::uint32_t count = 0;
  std::memcpy(&count, text.data() + 80, sizeof count);
  return count;
}

std::vector<std::array<double, 3>> binary_corners(const std::string& text) {
  std::vector<std::array<double, 3>> corners;
  const std::size_t count = triangles_stated(text);
  corners.reserve(3 * count);
  for (std::size_t t = 0; t < count; ++t) {
    for (std::size_t k = 1; k <= 3; ++k) {
      std::array<float, 3> corner{};
      std::memcpy(corner.data(), text.data() + kHeader + t * kTriangle + k * sizeof corner, sizeof corner);
      corners.push_back({corner[0], corner[1], corner[2]});
    }
  }
  return corners;
}

std::vector<std::array<double, 3>> text_corners(const std::string& text) {
  std::vector<std::array<double, 3>> corners;
  std::istringstream in(text);
  for (std::string word; in >> word;) {
    if (word != "vertex") continue;
    std::array<double, 3> corner{};
    if (!(in >> corner[0] >> corner[1] >> corner[2])) return {};
    corners.push_back(corner);
  }
  return corners;
}

}  // namespace

std::vector<std::array<double, 3>> read_stl(const std::string& path) {
  const std::string text = host::read_file(path, "mesh");
  const bool is_binary = text.size() >= kHeader && triangles_stated(text) <= kMostTriangles &&
                         text.size() == kHeader + kTriangle * triangles_stated(text);
  const auto corners = is_binary ? binary_corners(text) : text_corners(text);
  bool usable = !corners.empty() && corners.size() % 3 == 0 && corners.size() <= 3 * kMostTriangles;
  for (const auto& corner : corners) {
    for (const double x : corner) usable = usable && std::isfinite(x);
  }
  if (!usable) {
    throw UrdfError(
        fmt::format("{}: found no triangles; expected an STL file, binary or text, of at most {} triangles; "
                    "convert the mesh",
                    path, kMostTriangles));
  }
  return corners;
}

}  // namespace heft::urdf

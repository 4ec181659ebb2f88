// The file of loads and deflections: what it may hold, and what is said of a bad one.
#include <string>

#include <gtest/gtest.h>

#include "heft/data/deflections.hpp"
#include "heft/host/error.hpp"
#include "heft/host/file.hpp"
#include "support/temporary_folder.hpp"

namespace heft::data {
namespace {

class Deflections : public ::testing::Test {
 protected:
  std::string file(const std::string& text) {
    const std::string path = folder_.path("m.csv");
    host::write_file_atomically(path, text);
    return path;
  }
  /// The message of the refusal; empty when the file is taken.
  std::string refusal(const std::string& text) {
    try {
      read_deflections(file(text), 2, "arm");
    } catch (const DataError& error) {
      return error.what();
    }
    return {};
  }
  test::TemporaryFolder folder_;
};

TEST_F(Deflections, ReadsComponentsWiresAndWhatWasNotMeasured) {
  std::vector<std::string> notes;
  const auto rows = read_deflections(file("# a comment\n"
                                          "pose,frame,q1,q2,fz,mx,dx,dy,rz,d,ux,uy,uz,px,sigma,note\n"
                                          "a,tool,0.1,-0.2,-50,1.5,,0.0002,1e-5,-3e-4,0,3,4,0.1,1e-5,x\n"
                                          ",,0,0,0,1,1e-4,,,,,,,,,\n"),
                                     2, "arm", &notes);
  ASSERT_EQ(rows.size(), 2u);
  EXPECT_EQ(rows[0].pose, "a");
  EXPECT_TRUE(rows[0].tool_axes);
  EXPECT_DOUBLE_EQ(rows[0].q[1], -0.2);
  EXPECT_TRUE(rows[0].force.isApprox(Eigen::Vector3d(0, 0, -50)));
  EXPECT_TRUE(rows[0].moment.isApprox(Eigen::Vector3d(1.5, 0, 0)));
  EXPECT_TRUE(rows[0].point.isApprox(Eigen::Vector3d(0.1, 0, 0)));
  ASSERT_EQ(rows[0].readings.size(), 3u);
  EXPECT_FALSE(rows[0].readings[0].rotation);
  EXPECT_TRUE(rows[0].readings[0].direction.isApprox(Eigen::Vector3d::UnitY()));
  EXPECT_DOUBLE_EQ(rows[0].readings[0].sigma, 1e-5);
  EXPECT_TRUE(rows[0].readings[1].rotation);
  EXPECT_DOUBLE_EQ(rows[0].readings[1].sigma, 0.0);
  EXPECT_TRUE(rows[0].readings[2].direction.isApprox(Eigen::Vector3d(0, 0.6, 0.8)));
  EXPECT_EQ(rows[1].pose, "2");
  EXPECT_FALSE(rows[1].tool_axes);
  ASSERT_EQ(rows[1].readings.size(), 1u);
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_NE(notes[0].find("note"), std::string::npos);
}

TEST_F(Deflections, RefusesWithPlaceAndRemedy) {
  const struct {
    const char* text;
    const char* expected;
  } cases[] = {
      {"", "the file is empty"},
      {"q1,q2,fz,dx\n", "ends after its header"},
      {"q1,fz,dx\n0,1,1e-4\n", "robot 'arm' has 2 joints"},
      {"q1,q2,force,dx\n0,0,50,1e-4\n", "the wrench has no direction"},
      {"q1,q2,dx\n0,0,1e-4\n", "no load"},
      {"q1,q2,fz\n0,0,1\n", "no deflection"},
      {"q1,q2,fz,d\n0,0,1,1e-4\n", "displacement without direction"},
      {"q1,q2,fz,d,ux,uy,uz\n0,0,1,1e-4,0,0,0\n", "the direction is zero"},
      {"q1,q2,fz,dx\n0,0,0,1e-4\n", "force and moment are zero"},
      {"q1,q2,fz,dx\n0,0,1,\n", "nothing was measured"},
      {"q1,q2,fz,dx\n0,0,1,0.2mm\n", "m.csv:2: column 'dx': found '0.2mm'"},
      {"q1,q2,fz,dx\n0,0,1,nan\n", "column 'dx': found 'nan'"},
      {"q1,q2,fz,dx\n0,,1,1e-4\n", "column 'q2': found an empty field"},
      {"q1,q2,fz,dx\n0,0,1\n", "found 3 fields; expected 4"},
      {"q1,q2,fz,dx\n0,0,1,0.31\n", "give metres and radians"},
      {"q1,q2,fz,dx,frame\n0,0,1,1e-4,flange\n", "expected base or tool"},
      {"q1,q2,fz,dx,sigma\n0,0,1,1e-4,-1\n", "expected a standard deviation"},
      {"q1,q1,fz,dx\n0,0,1,1e-4\n", "'q1' is there twice"},
  };
  for (const auto& c : cases)
    EXPECT_NE(refusal(c.text).find(c.expected), std::string::npos) << c.text << refusal(c.text);
  EXPECT_THROW(read_deflections("missing.csv", 2, "arm"), InputError);
}

}  // namespace
}  // namespace heft::data

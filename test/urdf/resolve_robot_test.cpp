#include <cstdlib>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "heft/host/error.hpp"
#include "heft/urdf/urdf_import.hpp"
#include "support/temporary_folder.hpp"

namespace heft::urdf {
namespace {

using heft::test::message_of;
using heft::test::TemporaryFolder;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;

/// Sets HEFT_URDF_PATH for the length of a test.
class SearchPath {
 public:
  explicit SearchPath(const std::string& value) { ::setenv("HEFT_URDF_PATH", value.c_str(), 1); }
  ~SearchPath() { ::unsetenv("HEFT_URDF_PATH"); }
};

TEST(ResolveRobot, FindsTheRobotsThatComeWithHeft) {
  for (const char* name : {"kawasaki6r", "ur5", "ur5e", "ur10e", "panda", "scara"}) {
    EXPECT_THAT(resolve_robot(name), EndsWith(std::string("/") + name + ".urdf"));
    EXPECT_EQ(resolve_robot(name), resolve_robot(std::string(name) + ".urdf"));
  }
}

TEST(ResolveRobot, ReturnsAPathAsItIs) {
  const TemporaryFolder folder;
  const std::string path = folder.write("arm.xml", "<robot/>");
  EXPECT_EQ(resolve_robot(path), path);
}

TEST(ResolveRobot, LooksInTheUsersFoldersFirst) {
  const TemporaryFolder empty, folder;
  const std::string own = folder.write("ur5e.urdf", "<robot/>");
  const SearchPath path(":" + empty.path("none") + ":" + folder.path("") + ":");
  EXPECT_TRUE(std::filesystem::equivalent(resolve_robot("ur5e"), own));
  EXPECT_THAT(resolve_robot("panda"), EndsWith("panda.urdf"));
}

TEST(ResolveRobot, ListsTheRobotsItKnows) {
  const TemporaryFolder folder;
  folder.write("mine.urdf", "<robot/>");
  const SearchPath path(folder.path(""));
  EXPECT_THAT(
      message_of<UrdfError>([] { resolve_robot("ur55"); }),
      AllOf(HasSubstr("ur55: no such file and no robot of that name; known robots: "), HasSubstr("mine"),
            HasSubstr("ur5e"), HasSubstr(folder.path("")), HasSubstr("HEFT_URDF_PATH")));
}

TEST(ResolveRobot, RefusesPathsThatAreNoFiles) {
  const TemporaryFolder folder;
  EXPECT_THAT(message_of<UrdfError>([&] { resolve_robot(folder.path("arm.urdf")); }),
              HasSubstr("there is no such file"));
  EXPECT_THAT(message_of<UrdfError>([&] { resolve_robot(folder.path("")); }),
              HasSubstr("is a folder; expected a URDF file"));
  EXPECT_THAT(message_of<UrdfError>([] { resolve_robot(""); }), HasSubstr("no robot was named"));
}

}  // namespace
}  // namespace heft::urdf

/// @file
/// Tests that rest on measured logs or on vectors of another program, which are not part of the repository: they are
/// skipped where those are missing, and each says so in a line that tools/test counts.
#pragma once

#include <cstdio>
#include <filesystem>

#include <gtest/gtest.h>

namespace heft::test {

/// Whether measured data are there; prints "[ MEASURED ] checked ..." or "[ MEASURED ] not checked ...".
/// @param path  a file or folder below HEFT_DATA_DIR or HEFT_REFERENCE_DIR
inline bool has_measured_data(const std::filesystem::path& path) {
  const bool there = std::filesystem::exists(path);
  std::printf("[ MEASURED ] %s %s\n", there ? "checked with" : "not checked: there is no", path.c_str());
  return there;
}

}  // namespace heft::test

/// Skips the test unless a file or folder is there.
#define HEFT_NEEDS_MEASURED_DATA(path) \
  if (!::heft::test::has_measured_data(path)) GTEST_SKIP() << "no measured data at " << (path)

// Carries the precompiled headers of the tests; see heft_test_headers() in tools/cmake/HeftTargets.cmake.

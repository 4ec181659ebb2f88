// Carries precompiled headers; see heft_precompiled() in HeftTargets.cmake.

/// @file
/// The files of src/page/script as texts; CMake makes page_script_text.cpp of them.
#pragma once

namespace heft::page {

extern const char* const kScriptHead;
extern const char* const kScriptPlots;
extern const char* const kScriptTables;
extern const char* const kScriptFiles;

}  // namespace heft::page

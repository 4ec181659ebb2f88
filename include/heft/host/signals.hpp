/// @file
/// How a program that writes files behaves when a signal ends it.
#pragma once

namespace heft::host {

/// From now on SIGINT, SIGTERM, SIGHUP, SIGQUIT and SIGXCPU remove files that are half written and folders that were
/// made and are still empty; then they end the process as before. Signals that are ignored stay ignored.
/// A library does not touch signals unasked: a program calls this once at its start.
void remove_temporaries_on_signals();

}  // namespace heft::host

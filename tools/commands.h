/// \file commands.h
/// Every command of `tessera`, one function per file tools/<command>_command.cpp.
#pragma once

namespace CLI {
class App;
}

namespace tessera {

// one line per command, alphabetical
void add_parameterize(CLI::App& app);
void add_plan(CLI::App& app);
void add_reconstruct(CLI::App& app);
void add_check(CLI::App& app);
void add_render(CLI::App& app);
void add_convert(CLI::App& app);
void add_decimate(CLI::App& app);
void add_info(CLI::App& app);
void add_smooth(CLI::App& app);
void add_synth(CLI::App& app);
void add_task(CLI::App& app);

}  // namespace tessera

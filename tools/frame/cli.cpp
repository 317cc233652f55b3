#include "tools/frame/cli.h"

#include <csignal>
#include <cstdlib>
#include <iostream>
#include <new>

#include <unistd.h>

#include <fmt/format.h>
#include <CLI/CLI.hpp>

#include "octree/error.h"
#include "stream/files/durable_file.h"
#include "stream/files/json.h"
#include "stream/files/system_reason.h"
#include "stream/formats/points/virtual_cloud.h"
#include "stream/runtime/long_call.h"
#include "stream/runtime/stop.h"
#include "tools/frame/manual.h"
#include "tools/frame/version_text.h"

namespace tessera::cli {
namespace {

constexpr int kBugExit = 70;
constexpr int kSignalExit = 128;

/// --job of the line; one process has one line.
std::filesystem::path given_job_file;

std::vector<std::string> option_names(const CLI::App& command) {
  std::vector<std::string> names;
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
  }
  return names;
}

const CLI::App& chosen_command(const CLI::App& app) {
  const auto parsed = app.get_subcommands();
  return parsed.empty() ? app : *parsed.front();
}

/// The sentence for words that CLI11 could not place.
std::string unknown_words(const CLI::App& app) {
  const CLI::App& command = chosen_command(app);
  const std::vector<std::string> words = app.remaining(true);
  const std::string word = words.empty() ? "" : words.front();
  if (&command == &app) {
    std::vector<std::string> names;
    for (const CLI::App* sub : app.get_subcommands([](const CLI::App*) { return true; })) {
      names.push_back(sub->get_name());
    }
    if (word.rfind('-', 0) == 0)
      return fmt::format("unknown option {}{}", word, did_you_mean(word, option_names(app)));
    return fmt::format("unknown command '{}'{}", word, did_you_mean(word, names));
  }
  const std::string name = word.substr(0, word.find('='));
  if (name.rfind('-', 0) != 0) return fmt::format("{}: unexpected argument '{}'", command.get_name(), word);
  return fmt::format("{}: unknown option {}{} (see {} {} --help)", command.get_name(), name,
                     did_you_mean(name, option_names(command)), app.get_name(), command.get_name());
}

/// Fills options that the line did not give.
void apply_job_file(const CLI::App& line, const OptionTable& options, const std::filesystem::path& path) {
  if (!std::filesystem::is_regular_file(path))
    throw InputError(fmt::format("{}: cannot read the job file; name a file of JSON", path.string()));
  const std::string text = read_text(path);
  Json job;
  try {
    job = parse_json(text);
  } catch (const JsonError& e) {
    throw InputError(fmt::format("{}: not valid JSON: {}", path.string(), e.what()));
  }
  if (!job.is_object())
    throw InputError(fmt::format("{}: the job file must be one JSON object", path.string()));
  try {
    options.from_json(job, [&](const OptionRow& row) { return line.get_option(row.typed())->count() > 0; });
  } catch (const UsageError& e) {
    throw UsageError(fmt::format("{}: {}", path.string(), e.what()));
  }
}

/// A row as the parser knows it; it hands the words on and converts nothing.
void add_option(CLI::App& line, const OptionRow& row) {
  std::string names;
  for (const std::string& name : row.names) {
    const bool is_short = name.size() == 1 && !names.empty();  // the first name is the key: long, even `--h`
    const char* dashes = row.is_positional ? "" : is_short ? "-" : "--";
    names += (names.empty() ? "" : ",") + (dashes + name);
  }
  CLI::Option* option = nullptr;
  if (row.is_flag) {
    option = line.add_flag_function(
        names,
        [row](std::int64_t count) {
          for (; count > 0; --count) row.set({"true"});
          if (count < 0) row.set({"false"});
        },
        row.help);
  } else {
    option = line.add_option(
        names,
        [row](const CLI::results_t& words) {
          row.set(words);
          return true;
        },
        row.help);
    option->type_name(row.placeholder)->default_str(row.value_text());
  }
  if (row.is_list())
    option->expected(1, CLI::detail::expected_max_vector_size)->allow_extra_args(row.is_positional);
  if (!row.group.empty()) option->group(row.group);
  if (row.is_hidden) option->group("");
}

void add_command(CLI::App& app, const Command& command) {
  CLI::App* line = app.add_subcommand(command.name, command.description);
  for (const OptionRow& row : command.options.rows()) add_option(*line, row);
  line->add_flag_callback(
          "--markdown",
          [&command] {
            std::cout << command.options.markdown();
            throw CLI::Success();
          },
          "print the options as a table for the README and stop")
      ->group("");
  if (command.rest != nullptr) {
    line->allow_extras();
    line->callback([&command, line] {
      *command.rest = line->remaining();
      catch_stop_signals();
      command.run();
    });
    return;
  }
  auto job = std::make_shared<std::string>();
  line->add_option("--job", *job, "JSON file with every option by the same key; options given here win")
      ->type_name("FILE");
  line->callback([&command, line, job] {
    given_job_file = *job;
    if (!job->empty()) apply_job_file(*line, command.options, *job);
    catch_stop_signals();
    command.run();
  });
}

/// Failures to read the line become sentences.
void parse_line(CLI::App& app, const std::function<void()>& parse) {
  try {
    parse();
  } catch (const CLI::Success& e) {
    app.exit(e);
  } catch (const CLI::ExtrasError&) {
    throw UsageError(unknown_words(app));
  } catch (const CLI::ParseError& e) {
    if (!app.remaining(true).empty()) throw UsageError(unknown_words(app));
    const CLI::App& command = chosen_command(app);
    const std::string where = &command == &app ? "" : command.get_name() + ": ";
    throw UsageError(where + e.what());
  }
}

int fail(int code, const std::string& message) {
  std::cerr << "tessera: error: " << message << std::endl;
  return code;
}

int guarded(const std::function<void()>& body) {
  try {
    body();
    std::cout.flush();
    return static_cast<int>(ExitCode::kDone);
  } catch (const StoppedError& e) {
    if (stop_signal() != 0) return fail(kSignalExit + stop_signal(), e.what());
    return fail(static_cast<int>(e.code()), e.what());
  } catch (const Error& e) {
    return fail(static_cast<int>(e.code()), e.what());
  } catch (const std::bad_alloc&) {
    return fail(
        static_cast<int>(ExitCode::kResources),
        "out of memory: give a smaller --memory, so that work is cut finer, or free memory on this machine");
  } catch (const std::filesystem::filesystem_error& e) {
    const int error = e.code().value();
    return fail(static_cast<int>(is_limit(error) ? ExitCode::kResources : ExitCode::kInput),
                fmt::format("{}: {}", e.path1().empty() ? "the work directory" : e.path1().string(),
                            os_reason(error)));
  } catch (const std::exception& e) {
    return fail(kBugExit, fmt::format("this is a bug of Tessera, please report it: {}", e.what()));
  }
}

}  // namespace

void add_inputs(OptionTable& table, std::vector<std::string>& inputs) {
  table
      .add("inputs", &inputs,
           "files, folders, globs, virtual point clouds (.vpc) or @list (a file with one path per line)")
      .positional();
}

void add_output(OptionTable& table, std::filesystem::path& output, const std::string& help) {
  table.add("out,o", &output, help);
}

void add_threads(OptionTable& table, int& threads, const std::string& help) {
  table.add("threads,t", &threads, help + "; 0 = one per core").within(0, 4096);
}

std::vector<std::filesystem::path> expand_and_tell(const std::vector<std::string>& inputs) {
  InputList list = list_inputs(inputs);
  for (const std::string& line : list.notes) fmt::print(stderr, "tessera: {}\n", line);
  return std::move(list.files);
}

void require_inputs(const std::vector<std::string>& inputs) {
  if (inputs.empty()) throw UsageError("no input given: name files, folders, globs or @list");
}

void require_output(const std::filesystem::path& output) {
  if (output.empty()) throw UsageError("no output given: name it with -o FILE");
}

void require_new_output(const std::filesystem::path& output, bool force,
                        const std::vector<std::filesystem::path>& reads) {
  require_output(output);
  check_line_writes(reads, {{output, "-o", existing_by(force)}});
}

void check_line_writes(std::vector<std::filesystem::path> reads, const std::vector<PlannedWrite>& writes) {
  reads.push_back(given_job_file);
  check_writes(reads, writes);
}

std::vector<std::filesystem::path> also_read(const std::vector<std::string>& inputs) {
  std::vector<std::filesystem::path> files = {given_job_file};
  for (const std::string& input : inputs)
    if (input.size() > 1 && input.front() == '@')
      files.emplace_back(input.substr(1));
    else if (is_virtual_cloud(input))
      files.emplace_back(input);
  return files;
}

void add_force(OptionTable& table, bool& force) {
  table.add("force", &force, "replace what is written if it exists");
}

std::filesystem::path one_input(const std::vector<std::filesystem::path>& inputs, const std::string& verb) {
  if (inputs.size() > 1)
    throw UsageError(
        fmt::format("meshes are {} one at a time, but there are {} inputs: give one", verb, inputs.size()));
  return inputs.front();
}

ProgressSink stderr_sink() {
  return {[](const std::string& text) { std::cerr << text << std::flush; }, ::isatty(STDERR_FILENO) == 1};
}

void print_repairs(const std::string& input, const Json& report) {
  const Json& repair = report.at("input").at("repair");
  static const std::pair<const char*, const char*> kWords[] = {
      {"nonfinite_vertices", "vertices without finite coordinates"},
      {"bad_faces", "faces that name no vertex dropped"},
      {"degenerate_faces", "degenerate faces dropped"},
      {"duplicate_faces", "duplicate faces dropped"},
      {"nonmanifold_edges", "edges with more than two faces taken apart"},
      {"inconsistent_edges", "edges cut where neighbours face opposite sides"},
      {"turned_faces", "faces turned"},
      {"split_vertices", "vertices split"}};
  std::string text;
  for (const auto& [key, words] : kWords) {
    const auto count = repair.value(key, std::uint64_t{0});
    if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, words);
  }
  if (!text.empty()) fmt::print("{}: repaired: {}\n", input, text);
  for (const Json& w : report.value("warnings", Json::array()))
    fmt::print(stderr, "tessera: warning: {}\n", w.get<std::string>());
}

void print_tolerance(const Json& report) {
  if (!report.contains("tolerance")) return;
  const Json& t = report.at("tolerance");
  const bool scan = t.contains("h");
  fmt::print("tolerance {:.4g}: {} is {:.4g}, the noise {:.3g}\n", t.at("taken").get<double>(),
             scan ? "h" : "an edge", t.at(scan ? "h" : "edge").get<double>(), t.at("noise").get<double>());
}

void print_smoothing(const Json& report) {
  if (!report.contains("smoothing")) return;
  const Json& smoothing = report.at("smoothing");
  fmt::print("smoothed by {}: noise {:.3g} before, {:.3g} left; moved by {:.3g} at most, {:.3g} rms\n",
             smoothing.at("method").get<std::string>(), smoothing.at("noise").at("before").get<double>(),
             smoothing.at("noise").at("after").get<double>(), smoothing.at("largest_move").get<double>(),
             smoothing.at("rms_move").get<double>());
}

void print_texture(const Json& report) {
  if (!report.contains("texture")) return;
  const Json texture = report.at("texture");
  const auto of = [&](const char* stage) { return texture.value(stage, Json::object()); };
  const Json charts = of("charts"), pack = of("pack"), texels = of("texels"), scale = of("scale");
  fmt::print(
      "textures: {} pages, {} texels of {:.4g}, {} charts, {:.3g} per 1,000 faces, stretch {:.3f}, "
      "{:.1f} % of the pages used\n",
      pack.value("pages", Json::array()).size(), texels.value("texels", std::uint64_t{0}),
      scale.value("texel", 0.0), charts.value("charts", std::uint64_t{0}),
      charts.value("charts_per_1000_faces", 0.0), charts.value("stretch_l2", 0.0),
      100.0 * pack.value("used_share", 0.0));
  if (!texels.contains("psnr_db")) return;
  fmt::print("colours at points: {:.2f} dB (PSNR)", texels.at("psnr_db").get<double>());
  if (texels.contains("vertex_colours_psnr_db"))
    fmt::print(", by the colours of vertices {:.2f} dB", texels.at("vertex_colours_psnr_db").get<double>());
  if (texels.contains("points_around_psnr_db"))
    fmt::print(", of points by those around them {:.2f} dB",
               texels.at("points_around_psnr_db").get<double>());
  fmt::print("\n");
}

void run_words(const std::string& name, const std::vector<Command>& commands,
               const std::vector<std::string>& words) {
  CLI::App app("", name);
  app.require_subcommand(1);
  for (const Command& command : commands) add_command(app, command);
  std::vector<std::string> backwards(words.rbegin(), words.rend());  // as the parser wants them
  parse_line(app, [&] { app.parse(backwards); });
}

int run(const std::string& name, const std::string& description, const std::vector<Command>& commands,
        int argc, char** argv) {
  CLI::App app(description, name);
  app.set_version_flag("--version", [name] { return version_text(name); });
  app.require_subcommand(1);
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on file sizes is told like a full disk
  const int code = guarded([&] {
    for (const Command& command : commands) add_command(app, command);
    const auto add_text = [&](const char* option, const char* help,
                              const std::function<std::string()>& text) {
      app.add_flag_callback(
             option,
             [text] {
               std::cout << text();
               throw CLI::Success();
             },
             help)
          ->group("");
    };
    add_text("--man-page", "print the manual page", [&] { return man_page(name, description, commands); });
    add_text("--bash-completion", "print the completion for bash",
             [&] { return bash_completion(name, commands); });
    parse_line(app, [&] { app.parse(argc, argv); });
  });
  if (work_left_behind()) {
    std::cout.flush();
    std::_Exit(code);
  }
  return code;
}

}  // namespace tessera::cli

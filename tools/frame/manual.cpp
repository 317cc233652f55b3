#include "tools/frame/manual.h"

#include <utility>

#include <fmt/format.h>

namespace tessera::cli {
namespace {

/// As the README has them.
constexpr std::pair<const char*, const char*> kExitCodes[] = {
    {"0", "done"},
    {"2", "options that make no sense"},
    {"3", "input unreadable or invalid"},
    {"4", "memory cap or disk cannot suffice (the message names what would)"},
    {"5", "nothing to output"},
    {"6", "tolerance or validation failed"},
    {"7", "stopped before the end, resumable"},
    {"70", "a bug in Tessera"},
    {"130, 143", "interrupted (SIGINT, SIGTERM) after a clean journal; resumable"},
};

/// Text as roff prints it: no escapes, no requests, real minus signs so that options can be copied.
std::string roff(const std::string& text) {
  std::string safe;
  for (const char c : text) {
    if ((c == '.' || c == '\'') && (safe.empty() || safe.back() == '\n')) safe += "\\&";
    if (c == '\\') {
      safe += "\\e";
    } else if (c == '-') {
      safe += "\\-";
    } else {
      safe += c;
    }
  }
  return safe;
}

bool is_shown(const OptionRow& row) {
  return !row.is_hidden && !row.is_positional;
}

/// "--threads", "-t"
std::vector<std::string> dashed(const OptionRow& row) {
  std::vector<std::string> names;
  for (std::size_t i = 0; i < row.names.size(); ++i)
    names.push_back((i > 0 && row.names[i].size() == 1 ? "-" : "--") + row.names[i]);
  return names;
}

std::string option_text(const OptionRow& row) {
  std::string names;
  for (const std::string& name : dashed(row))
    names += (names.empty() ? "" : ", ") + ("\\fB" + roff(name) + "\\fR");
  if (!row.placeholder.empty()) names += " \\fI" + roff(row.placeholder) + "\\fR";
  std::string text = ".TP\n" + names + "\n" + roff(row.help);
  if (const std::string value = row.value_text(); !value.empty()) text += " [" + roff(value) + "]";
  return text + "\n";
}

}  // namespace

std::string man_page(const std::string& name, const std::string& description,
                     const std::vector<Command>& commands) {
  std::string text = fmt::format(
      ".TH {} 1 \"\" \"{} {}\" \"User Commands\"\n.SH NAME\n{} \\- {}\n.SH SYNOPSIS\n.B {}\n\\fICOMMAND\\fR "
      "[\\fIOPTIONS\\fR]\n",
      "TESSERA", name, TESSERA_VERSION, name, roff(description), name);
  text +=
      ".SH DESCRIPTION\nInputs are files, folders, globs (quoted) and @list files. Lengths are in the unit "
      "of the scan. Every "
      "command takes \\fB\\-\\-help\\fR, and \\fB\\-\\-job\\fR \\fIFILE\\fR: JSON with every option by the "
      "same key; "
      "options of the line win.\n";
  for (const Command& command : commands) {
    text += fmt::format(".SH \"{} {}\"\n{}\n", name, command.name, roff(command.description));
    std::string group;
    for (const OptionRow& row : command.options.rows()) {
      if (!is_shown(row)) continue;
      if (row.group != group && !row.group.empty()) text += ".SS \"" + roff(row.group) + "\"\n";
      group = row.group;
      text += option_text(row);
    }
  }
  text += ".SH EXIT STATUS\n";
  for (const auto& [code, meaning] : kExitCodes) text += fmt::format(".TP\n{}\n{}\n", code, roff(meaning));
  return text;
}

std::string bash_completion(const std::string& name, const std::vector<Command>& commands) {
  std::string all, cases;
  for (const Command& command : commands) {
    all += (all.empty() ? "" : " ") + command.name;
    std::string options = "--help --job", words;
    for (const OptionRow& row : command.options.rows()) {
      if (!is_shown(row)) continue;
      for (const std::string& option : dashed(row)) options += " " + option;
      if (row.words.empty()) continue;
      std::string names, values;
      for (const std::string& option : dashed(row)) names += (names.empty() ? "" : "|") + option;
      for (const std::string& word : row.words) values += (values.empty() ? "" : " ") + word;
      words += fmt::format("        {}) COMPREPLY=($(compgen -W \"{}\" -- \"$word\")); return ;;\n", names,
                           values);
    }
    cases += fmt::format("    {})\n{}      options=\"{}\"\n      ;;\n", command.name,
                         words.empty() ? "" : "      case $before in\n" + words + "      esac\n", options);
  }
  return fmt::format(R"(# bash completion of {0}, made from its option tables
_{0}() {{
  local word=${{COMP_WORDS[COMP_CWORD]}} before=${{COMP_WORDS[COMP_CWORD - 1]}} options
  if [ "$COMP_CWORD" -eq 1 ]; then
    COMPREPLY=($(compgen -W "{1} --help --version" -- "$word"))
    return
  fi
  case ${{COMP_WORDS[1]}} in
{2}  esac
  if [[ $word == -* ]]; then COMPREPLY=($(compgen -W "$options" -- "$word")); fi
}}
complete -o default -o filenames -F _{0} {0}
)",
                     name, all, cases);
}

}  // namespace tessera::cli

// Tables and plots of `tools/bench solvers` from the lines of solver_bench: like tables 7.1 and 7.2 of the thesis.
//   usage: solver_report LINES.jsonl FOLDER      writes FOLDER/solvers.md and FOLDER/time-<order>.svg
#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

namespace {

using nlohmann::json;

struct Column {
  const char *key, *title, *colour;
};
constexpr Column kColumns[] = {
    {"cg", "CG + IC", "#a63d40"},
    {"multigrid", "Multigrid", "#2a6f97"},
    {"hypre", "AMG (hypre)", "#90a959"},
    {"cholesky-amd", "Cholesky AMD", "#8d6a9f"},
    {"cholesky-nd", "Cholesky METIS", "#1b1b1e"},
};
constexpr Column kCounts[] = {{"count-amd", "AMD", ""},
                              {"count-nd", "METIS", ""},
                              {"count-rcm", "RCM", ""},
                              {"count-natural", "natural", ""}};

/// (mesh, order) -> unknowns -> solver -> row
using Rows = std::map<std::size_t, std::map<std::string, json>>;
using Groups = std::map<std::pair<std::string, int>, Rows>;

std::string count(double n) {
  return n >= 999e3 ? fmt::format("{:.3g}M", n / 1e6) : fmt::format("{:.0f}k", n / 1e3);
}
std::string mebibytes(const json& row, const char* key) {
  return fmt::format("{:.0f} MiB", row.value(key, 0.0) / 1048576.0);
}
std::string three_digits(double s) {
  return s < 0.1 ? fmt::format("{:.3f}", s) : s < 10.0 ? fmt::format("{:.2f}", s) : fmt::format("{:.1f}", s);
}
bool solved(const json& row) {
  return row.value("status", "") == "solved";
}
double precompute(const json& row) {
  return row.value("analyse_s", 0.0) + row.value("factor_s", 0.0);
}
double total(const json& row) {
  return row.value("setup_s", 0.0) + precompute(row) + row.value("solve_s", 0.0);
}
std::string failure(const json& row) {
  const std::string status = row.value("status", "missing");
  if (status == "too large") return "needs " + mebibytes(row, "predicted_bytes");
  if (status == "not converged") return fmt::format("no ({:.0e})", row.value("residual", 0.0));
  return status;
}

template <class Cell>
void table(std::ostream& out, const Rows& rows, const std::vector<Column>& columns, Cell cell) {
  out << "| unknowns |";
  for (const Column& c : columns) out << " " << c.title << " |";
  out << "\n|---|";
  for (std::size_t k = 0; k < columns.size(); ++k) out << "---|";
  out << "\n";
  for (const auto& [n, solvers] : rows) {
    out << "| " << count(static_cast<double>(n)) << " |";
    for (const Column& c : columns) {
      const auto it = solvers.find(c.key);
      out << " "
          << (it == solvers.end()  ? ""
              : solved(it->second) ? cell(it->second)
                                   : "— " + failure(it->second))
          << " |";
    }
    out << "\n";
  }
  out << "\n";
}

template <std::size_t kSize>
std::vector<Column> present(const Rows& rows, const Column (&all)[kSize]) {
  std::vector<Column> out;
  for (const Column& c : all)
    if (std::any_of(rows.begin(), rows.end(), [&](const auto& r) { return r.second.count(c.key) > 0; }))
      out.push_back(c);
  return out;
}

/// The time of each solver over the unknowns in one frame.
void panel(std::ostream& out, const Rows& rows, double x0, double y0, bool large, bool whole) {
  constexpr double kWidth = 330, kHeight = 220;
  double max_n = 0.0, max_s = 0.0;
  const auto seconds = [&](const json& r) { return whole ? total(r) : r.value("solve_s", 0.0); };
  const auto in_range = [&](std::size_t n) { return (n > 80000) == large; };
  for (const auto& [n, solvers] : rows)
    if (in_range(n)) {
      max_n = std::max(max_n, static_cast<double>(n));
      for (const auto& [key, r] : solvers)
        for (const Column& c : kColumns)
          if (c.key == key && solved(r)) max_s = std::max(max_s, seconds(r));
    }
  if (max_n == 0.0 || max_s == 0.0) return;
  // What takes far longer than the rest would flatten all other curves.
  std::vector<double> tops;
  for (const Column& c : kColumns) {
    double top = 0.0;
    for (const auto& [n, solvers] : rows)
      if (const auto it = solvers.find(c.key); in_range(n) && it != solvers.end() && solved(it->second))
        top = std::max(top, seconds(it->second));
    if (top > 0.0) tops.push_back(top);
  }
  std::sort(tops.begin(), tops.end());
  max_s = std::min(max_s, 6.0 * tops[tops.size() / 2]);
  out << fmt::format(
      "<g transform='translate({},{})'><rect width='{}' height='{}' fill='none' stroke='#999'/>\n", x0, y0,
      kWidth, kHeight);
  out << fmt::format("<text x='0' y='-8'>{} against unknowns</text>\n",
                     whole ? "total time (s)" : "3 solutions (s)");
  for (int k = 0; k <= 4; ++k) {
    out << fmt::format("<text x='-6' y='{}' text-anchor='end'>{:.2g}</text>\n", kHeight * (1 - k / 4.0) + 4,
                       max_s * k / 4.0);
    out << fmt::format("<text x='{}' y='{}' text-anchor='middle'>{}</text>\n", kWidth * k / 4.0, kHeight + 16,
                       count(max_n * k / 4.0));
  }
  for (const Column& c : kColumns) {
    std::string path;
    for (const auto& [n, solvers] : rows) {
      const auto it = solvers.find(c.key);
      if (!in_range(n) || it == solvers.end() || !solved(it->second) || seconds(it->second) > max_s) continue;
      const double x = kWidth * static_cast<double>(n) / max_n,
                   y = kHeight * (1.0 - seconds(it->second) / max_s);
      path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : " L", x, y);
      out << fmt::format("<circle cx='{:.1f}' cy='{:.1f}' r='2.5' fill='{}'/>\n", x, y, c.colour);
    }
    if (!path.empty())
      out << fmt::format("<path d='{}' fill='none' stroke='{}' stroke-width='1.5'/>\n", path, c.colour);
  }
  out << "</g>\n";
}

void plot(const std::string& path, const Rows& rows, int order, const std::string& mesh) {
  std::ofstream out(path);
  out << "<svg xmlns='http://www.w3.org/2000/svg' width='880' height='640' font-family='sans-serif' "
         "font-size='11'>\n"
         "<rect width='880' height='640' fill='white'/>\n";
  out << fmt::format("<text x='60' y='24' font-size='14'>Laplacian of order {}, {} mesh</text>\n", order,
                     mesh);
  double x = 60;
  for (const Column& c : present(rows, kColumns)) {
    out << fmt::format(
        "<rect x='{}' y='36' width='10' height='10' fill='{}'/><text x='{}' y='45'>{}</text>\n", x, c.colour,
        x + 14, c.title);
    x += 115;
  }
  for (const bool large : {false, true})
    for (const bool whole : {true, false}) panel(out, rows, large ? 510 : 60, whole ? 80 : 370, large, whole);
  out << "</svg>\n";
  if (!out) throw std::runtime_error("cannot write " + path);
}

void write(const Groups& groups, const std::string& folder) {
  std::ofstream out(folder + "/solvers.md");
  for (const auto& [key, rows] : groups) {
    const auto& [mesh, order] = key;
    const std::vector<Column> columns = present(rows, kColumns);
    out << fmt::format("## Laplacian of order {}, {} mesh\n\n", order, mesh);
    out << "Seconds: setup / precomputation / three solutions.\n\n";
    table(out, rows, columns, [](const json& r) {
      return fmt::format("{}/{}/{}", three_digits(r.value("setup_s", 0.0)), three_digits(precompute(r)),
                         three_digits(r.value("solve_s", 0.0)));
    });
    out << "Relative residual, peak memory, iterations.\n\n";
    table(out, rows, columns, [](const json& r) {
      const int iterations = r.value("iterations", 0);
      return fmt::format("{:.0e}, {}{}", r.value("residual", 0.0), mebibytes(r, "peak_bytes"),
                         iterations > 0 ? fmt::format(", {}", iterations) : "");
    });
    const std::vector<Column> counts = present(rows, kCounts);
    if (!counts.empty()) {
      out << "Nonzeros of the factor by ordering.\n\n";
      table(out, rows, counts,
            [](const json& r) { return fmt::format("{:.1f} M", r.value("factor_entries", 0.0) / 1e6); });
    }
    for (const auto& [n, solvers] : rows) {
      const auto bare = solvers.find("bare-cholmod"), ours = solvers.find("cholesky-nd");
      if (bare != solvers.end() && ours != solvers.end() && solved(bare->second) && solved(ours->second))
        out << fmt::format(
            "- {} unknowns: factor and 3 solutions {:.2f} s, bare CHOLMOD {:.2f} s (with ordering {:.2f} and "
            "{:.2f} s)\n",
            count(static_cast<double>(n)),
            ours->second.value("factor_s", 0.0) + ours->second.value("solve_s", 0.0),
            bare->second.value("factor_s", 0.0) + bare->second.value("solve_s", 0.0),
            precompute(ours->second) + ours->second.value("solve_s", 0.0),
            precompute(bare->second) + bare->second.value("solve_s", 0.0));
      if (const auto step = solvers.find("implicit-step"); step != solvers.end() && solved(step->second))
        out << fmt::format(
            "- {} unknowns: an implicit step {:.2f} s, {:.2f} s with the symbolic factor kept: {:.0f} % "
            "saved\n",
            count(static_cast<double>(n)), step->second.value("step_s", 0.0),
            step->second.value("reused_step_s", 0.0), 100.0 * step->second.value("saved", 0.0));
    }
    out << "\n";
    plot(fmt::format("{}/time-{}-{}.svg", folder, order, mesh), rows, order, mesh);
  }
  if (!out) throw std::runtime_error("cannot write " + folder + "/solvers.md");
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) {
    std::cerr << "usage: solver_report LINES.jsonl FOLDER\n";
    return 2;
  }
  try {
    std::ifstream in(argv[1]);
    if (!in) throw std::runtime_error(std::string("cannot read ") + argv[1]);
    Groups groups;
    for (std::string line; std::getline(in, line);) {
      if (line.empty()) continue;
      const json row = json::parse(line);
      groups[{row.at("mesh"), row.at("order")}][row.at("unknowns")][row.at("solver")] = row;
    }
    write(groups, argv[2]);
  } catch (const std::exception& e) {
    std::cerr << "solver_report: " << e.what() << "\n";
    return 70;
  }
  return 0;
}

// Non-zero patterns of a small Laplacian and of its Cholesky factor under four orderings, as an SVG: figure 7.2 of the
// thesis.
//   usage: factor_pattern FILE.svg
#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iostream>
#include <numeric>
#include <set>
#include <string>
#include <vector>

#include "solvers/laplacian_system.h"
#include "solvers/rcm_ordering.h"
#include "tests/helpers/cholmod_view.h"
#include "tests/helpers/irregular_mesh.h"

namespace {

using namespace tessera;

std::vector<std::int32_t> cholmod_ordering(const SparseMatrix& a, int method) {
  cholmod_common c;
  cholmod_start(&c);
  c.nmethods = 1;
  c.method[0].ordering = method;
  cholmod_sparse m = test::cholmod_view(a);
  cholmod_factor* f = cholmod_analyze(&m, &c);
  const int* p = static_cast<const int*>(f->Perm);
  std::vector<std::int32_t> order(p, p + a.rows);
  cholmod_free_factor(&f, &c);
  cholmod_finish(&c);
  return order;
}

/// Columns of the factor by elimination, and of the reordered matrix (lower triangles).
struct Patterns {
  std::vector<std::set<std::int32_t>> matrix, factor;
};

Patterns patterns(const SparseMatrix& a, const std::vector<std::int32_t>& order) {
  std::vector<std::int32_t> position(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) position[order[k]] = static_cast<std::int32_t>(k);
  Patterns p;
  p.matrix.resize(order.size());
  for (std::int32_t i = 0; i < a.rows; ++i)
    for (std::int32_t e = a.start[i]; e < a.start[i + 1]; ++e)
      if (position[a.column[e]] <= position[i]) p.matrix[position[a.column[e]]].insert(position[i]);
  p.factor = p.matrix;
  for (std::size_t j = 0; j < p.factor.size(); ++j) {
    const auto next = std::next(p.factor[j].begin());
    if (next == p.factor[j].end()) continue;
    p.factor[*next].insert(next, p.factor[j].end());
  }
  return p;
}

void dots(std::ostream& out, const std::vector<std::set<std::int32_t>>& columns, bool both, double x0,
          double y0, double size) {
  const double step = size / static_cast<double>(columns.size());
  std::string path;
  std::size_t entries = 0;
  for (std::size_t j = 0; j < columns.size(); ++j)
    for (const std::int32_t i : columns[j]) {
      const auto dot = [&](double row, double column) {
        path += fmt::format("M{:.1f} {:.1f}h{:.2f}", x0 + column * step, y0 + (row + 0.5) * step, step);
      };
      dot(i, static_cast<double>(j));
      if (both && static_cast<std::size_t>(i) != j) dot(static_cast<double>(j), i);
      entries += both && static_cast<std::size_t>(i) != j ? 2 : 1;
    }
  out << fmt::format("<rect x='{}' y='{}' width='{}' height='{}' fill='none' stroke='#999'/>\n", x0, y0, size,
                     size);
  out << fmt::format("<path d='{}' stroke='#123' stroke-width='{:.2f}'/>\n", path, step);
  out << fmt::format("<text x='{}' y='{}' text-anchor='middle'>{} non-zeros</text>\n", x0 + size / 2,
                     y0 + size + 14, entries);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) {
    std::cerr << "usage: factor_pattern FILE.svg\n";
    return 2;
  }
  const test::IrregularMesh mesh = test::irregular_mesh({.side = 29});
  const Laplacian l = laplacian({mesh.positions, mesh.faces});
  const SparseMatrix a = laplacian_system(l, 1, mesh.fixed).matrix;
  std::vector<std::int32_t> natural(static_cast<std::size_t>(a.rows));
  std::iota(natural.begin(), natural.end(), 0);
  const std::pair<const char*, std::vector<std::int32_t>> orders[] = {
      {"natural", natural},
      {"reverse Cuthill-McKee", reverse_cuthill_mckee(a)},
      {"minimum degree (AMD)", cholmod_ordering(a, CHOLMOD_AMD)},
      {"nested dissection (METIS)", cholmod_ordering(a, CHOLMOD_METIS)}};
  std::ofstream out(argv[1]);
  constexpr double kSize = 260;
  out << "<svg xmlns='http://www.w3.org/2000/svg' width='1160' height='640' font-family='sans-serif' "
         "font-size='12'>\n"
         "<rect width='1160' height='640' fill='white'/>\n";
  double x = 20;
  for (const auto& [title, order] : orders) {
    const Patterns p = patterns(a, order);
    out << fmt::format("<text x='{}' y='24' text-anchor='middle'>{}</text>\n", x + kSize / 2, title);
    dots(out, p.matrix, true, x, 36, kSize);
    dots(out, p.factor, false, x, 340, kSize);
    x += kSize + 26;
  }
  out << "</svg>\n";
  out.close();
  if (!out) {
    std::cerr << "factor_pattern: cannot write " << argv[1] << "\n";
    return 4;
  }
  return 0;
}

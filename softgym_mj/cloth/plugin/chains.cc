#include "cloth/plugin/chains.h"

#include <algorithm>
#include <cmath>

#include "cloth/plugin/springs.h"

namespace softgym_mj::cloth {

void ChainRows::Reset(const Mesh& mesh, double h) {
  rows_.clear();
  for (const Mesh::Chain& chain : mesh.chains) {
    Row row;
    row.vertex = chain.vertex;
    row.edge = chain.edge;
    for (int e : chain.edge) {
      const Mesh::Edge& edge = mesh.edges[e];
      const double damping = mesh.materials[mesh.part[edge.vertex[0]]].stretch_damping;
      const Compliance compliance = Comply(EdgeStiffness(mesh, edge), damping, h);
      row.length.push_back(static_cast<float>(edge.length));
      row.gamma.push_back(static_cast<float>(compliance.gamma));
      row.keep.push_back(static_cast<float>(1 - compliance.b));
    }
    const size_t size = chain.edge.size();
    row.start.resize(3 * size);
    for (auto* a : {&row.before, &row.impulse}) a->resize(size);
    for (auto* a : {&row.lower, &row.diagonal, &row.right}) a->resize(size);
    row.normal.resize(3 * size);
    rows_.push_back(row);
  }
}

void ChainRows::Start(const std::vector<double>& position, const double* after) {
  for (Row& row : rows_) {
    for (size_t e = 0; e < row.length.size(); ++e) {
      const float length = StartWay(position, row.vertex[e + 1], row.vertex[e], &row.start[3 * e]);
      row.before[e] = length - static_cast<float>(after[row.edge[e]]);
    }
  }
}

void ChainRows::Solve(const Points& points) {
  for (Row& row : rows_) SolveRow(points, &row);
}

// The edges form a tridiagonal system (Thomas' algorithm).
void ChainRows::SolveRow(const Points& points, Row* row) {
  const size_t size = row->length.size();
  double* n = row->normal.data();
  for (size_t e = 0; e < size; ++e) {
    const float *a = points.now + 4 * row->vertex[e], *b = points.now + 4 * row->vertex[e + 1];
    double square = 0;
    for (int k = 0; k < 3; ++k) {
      n[3 * e + k] = static_cast<double>(row->start[3 * e + k]) + (static_cast<double>(b[k]) - a[k]);
      square += n[3 * e + k] * n[3 * e + k];
    }
    const double now = std::max(std::sqrt(square), 1e-9);
    for (int k = 0; k < 3; ++k) n[3 * e + k] /= now;
    const double length = row->length[e];
    double diagonal = static_cast<double>(a[3]) + b[3] + row->gamma[e];
    double right = -((now - length) - row->keep[e] * (row->before[e] - length));
    row->lower[e] = 0;
    if (e > 0) {
      const double* m = n + 3 * e - 3;
      const double side = -a[3] * (m[0] * n[3 * e] + m[1] * n[3 * e + 1] + m[2] * n[3 * e + 2]);
      const double ratio = side / row->diagonal[e - 1];
      diagonal -= ratio * side;
      right -= ratio * row->right[e - 1];
      row->lower[e] = side;
    }
    row->diagonal[e] = diagonal;
    row->right[e] = right;
  }
  double impulse = 0;
  for (size_t i = size; i-- > 0;) {
    const double side = i + 1 < size ? row->lower[i + 1] : 0;
    impulse = (row->right[i] - side * impulse) / row->diagonal[i];
    row->impulse[i] = static_cast<float>(impulse);
    float *a = points.now + 4 * row->vertex[i], *b = points.now + 4 * row->vertex[i + 1];
    for (int k = 0; k < 3; ++k) {
      a[k] = static_cast<float>(a[k] - a[3] * impulse * n[3 * i + k]);
      b[k] = static_cast<float>(b[k] + b[3] * impulse * n[3 * i + k]);
    }
  }
  for (size_t e = 0; e < size; ++e) {
    const float *a = points.now + 4 * row->vertex[e], *b = points.now + 4 * row->vertex[e + 1];
    double square = 0;
    for (int k = 0; k < 3; ++k) {
      const double d = static_cast<double>(row->start[3 * e + k]) + (static_cast<double>(b[k]) - a[k]);
      square += d * d;
    }
    row->before[e] = static_cast<float>(std::sqrt(square));
  }
}

void ChainRows::AddHoldingForces(const Points& points, double share, std::vector<double>* forces) const {
  for (const Row& row : rows_) {
    for (size_t e = 0; e < row.length.size(); ++e) {
      const float way[3] = {static_cast<float>(row.normal[3 * e]), static_cast<float>(row.normal[3 * e + 1]),
                            static_cast<float>(row.normal[3 * e + 2])};
      AddForce(points, row.vertex[e + 1], way, share * row.impulse[e], forces);
      AddForce(points, row.vertex[e], way, -share * row.impulse[e], forces);
    }
  }
}

void ChainRows::Keep(const Points& points, double* after) const {
  for (const Row& row : rows_) {
    for (size_t e = 0; e < row.length.size(); ++e) {
      after[row.edge[e]] = LengthNow(points, row.vertex[e + 1], row.vertex[e], &row.start[3 * e]) - row.before[e];
    }
  }
}

}  // namespace softgym_mj::cloth

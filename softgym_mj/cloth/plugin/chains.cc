#include "cloth/plugin/chains.h"

#include "cloth/plugin/edges.h"
#include "cloth/plugin/springs.h"

namespace softgym_mj::cloth {
namespace {

ChainRow View(ChainRows::Row* row) {
  return {static_cast<int>(row->length.size()),
          row->vertex.data(),
          row->start.data(),
          row->length.data(),
          row->gamma.data(),
          row->keep.data(),
          row->before.data(),
          row->impulse.data(),
          row->lower.data(),
          row->diagonal.data(),
          row->right.data(),
          row->normal.data()};
}

}  // namespace

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
      const float length = StartWay(position.data(), row.vertex[e + 1], row.vertex[e], &row.start[3 * e]);
      row.before[e] = length - static_cast<float>(after[row.edge[e]]);
    }
  }
}

void ChainRows::Solve(const Points& points, bool settles) {
  for (Row& row : rows_) {
    const ChainRow chain = View(&row);
    const int size = chain.size;
    for (int e = 0; e < size; ++e) StartChainEdge(points, chain, e, settles);
    for (int e = 0; e < size; ++e) ConnectChainEdge(points, chain, e);
    SolveChain(chain);
    for (int i = 0; i <= size; ++i) MoveChainVertex(points, chain, i, settles);
  }
}

void ChainRows::End(const Points& points) {
  for (Row& row : rows_) {
    const ChainRow chain = View(&row);
    for (int e = 0; e < chain.size; ++e) EndChainEdge(points, chain, e);
  }
}

void ChainRows::AddHoldingForces(const Points& points, double share, std::vector<double>* forces) const {
  for (const Row& row : rows_) {
    for (size_t e = 0; e < row.length.size(); ++e) {
      const float way[3] = {static_cast<float>(row.normal[3 * e]), static_cast<float>(row.normal[3 * e + 1]),
                            static_cast<float>(row.normal[3 * e + 2])};
      AddForceIfHeld(points, row.vertex[e + 1], way, share * row.impulse[e], forces);
      AddForceIfHeld(points, row.vertex[e], way, -share * row.impulse[e], forces);
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

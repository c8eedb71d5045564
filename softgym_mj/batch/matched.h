// Smallest mean distance of a one-to-one matching of points to goals: `metrics.matched_distance` for many.

#ifndef SOFTGYM_MJ_BATCH_MATCHED_H_
#define SOFTGYM_MJ_BATCH_MATCHED_H_

#include <cmath>

namespace softgym_mj {
namespace {

constexpr int kMostMatched = 64;

// Solves the assignment by shortest augmenting paths (Jonker and Volgenant, 1987). `distance`: (count, count), at most
// `kMostMatched`.
inline double MatchedDistance(int count, const double* distance) {
  double of_row[kMostMatched + 1], of_column[kMostMatched + 1], least[kMostMatched + 1];
  int row_of[kMostMatched + 1], before[kMostMatched + 1];  // For columns, which count from 1; 0 means none.
  bool seen[kMostMatched + 1];
  for (int i = 0; i <= count; ++i) of_row[i] = of_column[i] = 0, row_of[i] = 0;
  for (int row = 1; row <= count; ++row) {
    for (int j = 0; j <= count; ++j) least[j] = 1e300, seen[j] = false;
    row_of[0] = row;
    int column = 0;
    while (row_of[column] != 0) {
      seen[column] = true;
      const int own = row_of[column];
      double step = 1e300;
      int next = 0;
      for (int j = 1; j <= count; ++j) {
        if (seen[j]) continue;
        const double slack = distance[count * (own - 1) + j - 1] - of_row[own] - of_column[j];
        if (slack < least[j]) least[j] = slack, before[j] = column;
        if (least[j] < step) step = least[j], next = j;
      }
      for (int j = 0; j <= count; ++j) {
        if (seen[j]) {
          of_row[row_of[j]] += step, of_column[j] -= step;
        } else {
          least[j] -= step;
        }
      }
      column = next;
    }
    while (column != 0) {
      row_of[column] = row_of[before[column]];
      column = before[column];
    }
  }
  double sum = 0;
  for (int row = 1; row <= count; ++row) {
    for (int j = 1; j <= count; ++j) sum += row_of[j] == row ? distance[count * (row - 1) + j - 1] : 0;
  }
  return sum / count;
}

}  // namespace
}  // namespace softgym_mj

#endif  // SOFTGYM_MJ_BATCH_MATCHED_H_

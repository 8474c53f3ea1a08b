#pragma once

#include <vector>

#include "loopd/report.h"

namespace loopd {

/// Eq. 1: min-max normalisation of `candidates` (best first) to [0, 1], in place; those below
/// `min_similarity` are dropped and at most `max_candidates` stay. If all scores are equal (one
/// candidate, or identical images) there is nothing to tell them apart: each gets 1.
void normalise_scores(std::vector<Candidate>& candidates, double min_similarity,
                      std::size_t max_candidates);

/// Eq. 2 and 3: Borda votes of the two normalised lists (best first), merged: images among the top
/// c of both (c = length of the shorter list) get the geometric mean of their votes; an image of
/// one list only keeps its own vote, ranked in its own list's length, times `one_list_penalty`. An
/// empty list leaves the decision to the other, unpenalised. Best first, ties by lower id.
///
/// Votes are divided by the length they were ranked in (c, or the list's own), so that a score is
/// in [0, 1] whatever the lengths: a list of one never silences the other. The order within one
/// kind of image is that of the paper.
void fuse(const std::vector<Candidate>& points, const std::vector<Candidate>& lines,
          double one_list_penalty, std::vector<Candidate>& fused);

}  // namespace loopd

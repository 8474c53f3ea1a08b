#pragma once

#include "base/log.h"

namespace loopd {

// The kinds of entry that loopd writes to the journal, for `journalctl MESSAGE_ID=...`; listed in
// loopd(8). Never changed, never used again for another kind.

inline constexpr MessageId kIdListening = "8d1f1b6c0a5e4f6c9b7de0a34c52f7b1";
inline constexpr MessageId kIdState = "3b0a2f1d9c874e6e8f42d6715ac0e98d";
inline constexpr MessageId kIdFrameLost = "c6e54d0792b14a3fb1f8a97d0e6b3c25";
inline constexpr MessageId kIdCamera = "5f9e7a4b1c3d4820a6d9e8f7b2c10345";
inline constexpr MessageId kIdReload = "e2b7c81f4d0948a5937c6f1e5a8b0d62";
inline constexpr MessageId kIdControl = "71a4d3e86f5b4c0d8e29b7f6c5d4a310";
inline constexpr MessageId kIdRecording = "a90c5be17f3d46e2b84f0d6c2e7a91b8";
inline constexpr MessageId kIdThreads = "d47f2a6b93e5481c8a0b5c7e1f9d3246";
inline constexpr MessageId kIdReportsDropped = "0e6d9b2c7a4f43518c3e7d1f6b8a5092";
inline constexpr MessageId kIdEnding = "b83e1c5d70f9426a9d4c8e2b6f7a1053";

}  // namespace loopd

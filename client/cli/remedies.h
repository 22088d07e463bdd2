// What the command says about remedies: what to try about elements that are not certified valid, in its own flags.
#pragma once

#include <string>

#include "core/diagnosis/remedies.h"
#include "varimesh/v1/quality.pb.h"

namespace varimesh::client {

/// A remedy of the library as a message of the contract, without the sentence, which is in the words of the contract.
v1::Remedy to_proto(const Remedy& remedy);

/// The flags of `varimesh optimise` that do it, for example "--repair split"; empty if no flag does.
std::string flags_of(const v1::Remedy& remedy);

/// What to do and why, for example "Try --repair split: tetrahedra are split to make room, which may help 2 elements."
/// If the server is older than the kinds of remedies, it is the server's sentence.
std::string sentence_of(const v1::Remedy& remedy);

}  // namespace varimesh::client

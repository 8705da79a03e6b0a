// One cluster of several contacts, from its numbers to what becomes of it.
#pragma once
#include <array>

#include "../gather.hpp"
#include "answer.hpp"
#include "reflections.hpp"
#include "validity_everything.hpp"

using Code = unsigned char;  // a status, or:
constexpr Code LEFT_TO_PYTHON = 0;

// The numbers of a cluster. Contacts name bodies by their places here.
struct Parts {
  struct Contact {
    int body[2];
    double x[8], copies;
  };
  std::vector<std::array<double, BODY>> bodies;
  std::vector<Contact> contacts;

  // Whether a contact is given twice, whichever of its bodies is named first.
  bool has_copies() const {
    for (const Contact& one : contacts)
      for (const Contact* other = contacts.data(); other != &one; ++other)
        if (one.x[0] == other->x[0] && is_copy(one, *other)) return true;
    return false;
  }

 private:
  static bool is_copy(const Contact& one, const Contact& other) {
    bool turned = one.body[0] == other.body[1] && one.body[1] == other.body[0];
    if (!turned && !(one.body[0] == other.body[0] && one.body[1] == other.body[1])) return false;
    for (int k = 0; k < 8; ++k)
      if (one.x[k] != (turned && k >= 3 && k < 6 ? -other.x[k] : other.x[k])) return false;
    return true;
  }
};

// The parts of a cluster whose contacts are listed: bodies get their places as they come. `place` is -1 for all bodies,
// and so again afterwards; `used` gets the bodies. body(b, x) and contact(k, x) give numbers.
template <class Body, class Contact>
Parts parts_of(const Pairs& pairs, const std::int64_t* first, const std::int64_t* last, std::vector<int>& place, std::vector<std::int64_t>& used, Body body, Contact contact) {
  Parts parts;
  auto place_of = [&](std::int64_t b) {
    if (place[b] < 0) {
      place[b] = static_cast<int>(used.size());
      used.push_back(b);
      body(b, parts.bodies.emplace_back().data());
    }
    return place[b];
  };
  for (auto k = first; k != last; ++k) {
    parts.contacts.push_back({{place_of(pairs.a[*k]), place_of(pairs.b[*k])}, {}, 1});
    contact(*k, parts.contacts.back().x);
  }
  for (std::int64_t b : used) place[b] = -1;
  return parts;
}

struct Cluster {
  Assembly scene;
  std::vector<int> movable;  // of each body, its place among those that can move, or -1
  double energy = 0;         // of those
  bool idle = false, off_unit = false, rubs = false;
  int fault = 0;             // of the first contact that has one, and its place
  size_t at_fault = 0;

  // Whether doubles do not hold its numbers: then they decide nothing.
  bool beyond() const { return !(std::isfinite(energy) && scene.is_finite() && scene.has_impulses()); }

  Cluster(const Parts& parts, bool frictionless) {
    std::vector<Given> given(parts.bodies.size());
    for (size_t i = 0; i < given.size(); ++i) {
      std::copy(parts.bodies[i].begin(), parts.bodies[i].end(), given[i].x);
      if (!given[i].rests()) given[i].look();
      movable.push_back(given[i].movable() ? scene.bodies++ : -1);
      if (movable[i] < 0) {
        scene.driven = scene.driven || given[i].moves();
        continue;
      }
      energy += given[i].energy;
      idle = idle || given[i].idle;
      scene.given.push_back(given[i]);
    }
    scene.touches.reserve(parts.contacts.size());
    for (Parts::Contact contact : parts.contacts) {
      auto [a, b] = contact.body;
      if (frictionless && contact.x[7] < INFINITY) contact.x[7] = std::fmin(contact.x[7], 0);  // what is at fault stays so
      double in[INPUTS] = {}, found;
      bool shapes[5];
      std::copy(given[a].x, given[a].x + BODY, in);
      std::copy(given[b].x, given[b].x + BODY, in + BODY);
      std::copy(contact.x, contact.x + 8, in + IN_CONTACT_POSITION_X);
      validity<double>(in, nullptr, &found, shapes);
      fault = static_cast<int>(found);
      if (fault) return;
      ++at_fault;
      off_unit = off_unit || shapes[4];
      rubs = rubs || contact.x[7] > 0;
      scene.add(given[a], given[b], movable[a], movable[b], contact.x, contact.copies);
    }
    scene.finish();
  }
};

// By which law, and with which numbers: see resolve_scene.py.
struct Asked {
  int law;
  double threshold, restitution_threshold;
  int budget;  // of reflections
};

struct Answer {
  Code code;
  Numbers numbers;
  double margin = INFINITY, restitution = -1;  // of all contacts; -1: each has its own
  bool slow = false, fell_back = false;
};

// MOREAU's impulses.
inline Struck stepped(const Assembly& scene, bool rubs) {
  if (rubs) return one_step(scene);
  auto parts = [](const Touch& touch) { return high(touch.velocity) >= 0; };
  if (std::all_of(scene.touches.begin(), scene.touches.end(), parts)) return {Outcome::ANSWERED, std::vector<DD>(scene.count)};
  Assembly::Projection found = scene.rebound();
  return {found.found == Found::LEAST ? Outcome::ANSWERED : Outcome::CONTRADICTORY, found.q, found.error};
}

// What resolve_cluster.py does, where doubles can decide it.
inline Answer answered(Cluster& cluster, const Asked& asked) {
  Assembly& scene = cluster.scene;
  Answer answer{LEFT_TO_PYTHON, {}};
  if (cluster.beyond()) {
    answer.code = STATUS_OUT_OF_RANGE;
    return answer;
  }
  if (scene.locked || scene.is_doubtful()) return answer;
  for (Touch& touch : scene.touches) {
    double speed = -touch.plain[0].velocity;
    bool slow = speed > 0 && speed < asked.restitution_threshold && touch.e > 0;
    if (slow) touch.e = 0;
    answer.slow = answer.slow || slow;
  }
  Struck struck;
  auto finish = [&] {
    answer.numbers = numbers_of(scene, struck, false);
    answer.code = answer.numbers.is_finite() ? STATUS_OK : STATUS_OUT_OF_RANGE;
    answer.margin = struck.margin;
    answer.restitution = struck.restitution;
  };
  if (asked.law == LAW_MOREAU) {
    struck = stepped(scene, cluster.rubs);
    if (struck.outcome == Outcome::ANSWERED) finish();
    if (answer.code != LEFT_TO_PYTHON && !answer.numbers.creates_energy) return answer;
    answer.fell_back = true;
  }
  struck = Reflections{scene}.resolve(asked.threshold, asked.budget);
  double undecided = struck.error;
  if (cluster.rubs && struck.outcome == Outcome::ANSWERED) struck = least_work(scene, struck);
  if (struck.outcome != Outcome::ANSWERED) answer.code = struck.outcome == Outcome::ENDLESS ? STATUS_PATH_TOO_LONG : STATUS_CONTRADICTORY_CONTACTS;
  else if (undecided == INFINITY) answer.code = LEFT_TO_PYTHON;
  else finish();
  return answer;
}

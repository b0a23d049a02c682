#include <chainmail/elastic.h>

#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <limits>
#include <utility>

namespace palpate::chainmail {

namespace {

constexpr double minEnergy = 1e-9;  // of tissue that springs back: with less it is at rest, within some micrometres [J]
constexpr double forgets = 10.0;    // longest times of relaxation after which nothing is left of it
constexpr int callsPerTurn = 2;     // from one term of the history to the next
constexpr int callsOfGiven = 20;    // in which windows that take over find their displacement
constexpr double maxBalance = 1.5;  // of forces that are far from balanced: these are taken as they are
// Way along the surface from which a ball slips as a whole, in friction times depth: (2 - nu) / (2 - 2 nu), at nu = 0.5.
// Source: R. D. Mindlin, "Compliance of elastic bodies in contact", J. Appl. Mech. 16, 1949.
constexpr double slipsWhole = 1.5;
constexpr double relievedFrom = 2.5, relievedAll = 3.0;  // of a tool's radius, in cells: see Elastic::relieve()
constexpr double notRelieved = 0.3;                      // friction from which cells are sheared so far that some snap [-]

// By how much a site's force falls with each component of its way [N/m].
glm::dmat3 tangentOf(const ContactSite& s) noexcept
{
    return s.limit > 0.0 ? glm::dmat3(s.resist({1, 0, 0}), s.resist({0, 1, 0}), s.resist({0, 0, 1}))
                         : s.across * glm::dmat3(1.0) + (s.stiffness - s.across) * glm::outerProduct(s.normal, s.normal);
}

// What the nodes of each cell get of the sites in it that touch, which follow each other.
// @param of   value of a site
// @param add  called with a site of the cell, a corner 0 to 7, and the sum of the sites' shares there
template <typename Of, typename Add>
void addByCell(std::span<const ContactSite> sites, const Of& of, const Add& add) noexcept
{
    using Value = decltype(of(sites.front()));
    for (auto first = sites.begin(); first != sites.end();) {
        std::array<Value, 8> sum;
        sum.fill(Value(0.0));
        bool touches = false;
        auto s = first;
        for (; s != sites.end() && s->node == first->node && s->level == first->level; ++s) {
            if (!s->active()) {
                continue;
            }
            touches = true;
            const Value value = of(*s);
            for (std::size_t c = 0; c < sum.size(); ++c) {
                sum[c] += static_cast<double>(s->fraction[c]) * value;
            }
        }
        for (std::size_t c = 0; touches && c < sum.size(); ++c) {
            add(*first, static_cast<int>(c), sum[c]);
        }
        first = s;
    }
}

}  // namespace

Elastic::Elastic(const ElasticBody& body, const ElasticOptions& options, const Focus& focus)
    : options_(options),
      reach_(volume::reachOf(options.law)),
      stack_(body, options.window, focus, options.kernels != nullptr ? *options.kernels : kernels()),
      multigrid_(stack_, 8 * sitesFor(body, options.touches, options.maxSites)),
      sites_(sitesFor(body, options.touches, options.maxSites))
{
    held_.reserve(maxTools);
    pressed_.reserve(maxTools);
    tools_.reserve(maxTools);
    shapes_.reserve(maxTools);
    foundFor_.reserve(maxTools);
    tiesFound_.reserve(maxTies);
    toolAt_.reserve(maxTools);
    slips_.reserve(sites_.size());
}

std::size_t Elastic::nodes() const noexcept
{
    std::size_t sum = 0;
    for (const Window& w : stack_.windows()) {
        const Index3 n = w.size();
        sum += static_cast<std::size_t>(n.x) * static_cast<std::size_t>(n.y) * static_cast<std::size_t>(n.z);
    }
    return sum;
}

Vec3 Elastic::displacement(Vec3 rest) const noexcept
{
    ContactSite site;
    locate(stack_.body(), stack_.windows(), rest, site);
    return site.level < stack_.size() ? gather(stack_.windows(), site, Field::u) : Vec3(0.0);
}

Vec3 Elastic::displacementOf(Index3 cell) const noexcept
{
    ContactSite site;
    locateMiddle(stack_.body(), stack_.windows(), cell, site);
    return site.level < stack_.size() ? gather(stack_.windows(), site, Field::u) : Vec3(0.0);
}

void Elastic::settle() noexcept
{
    products_.reset();
    siteCount_ = touching_ = 0;
    contactEnergy_ = 0.0;
    for (HeldTool& held : held_) {
        held.forgetContacts();
        held.blend.forget();
    }
    givenFor_ = 0;
    if (atRest_) {
        return;
    }
    for (const Field f : {Field::u, Field::a, Field::d, Field::e, Field::r}) {
        stack_.clear(f);
    }
    if (stack_.body().relaxes) {
        for (const Field f : {Field::h, Field::h0, Field::h1}) {
            stack_.clear(f);
        }
        since_ = {};
        historyEnergy_ = 0.0;
    }
    energy_ = 0.0;
    toolAt_.clear();
    atRest_ = true;
    hasIncrement_ = false;
}

// Force and energy at u: of the tissue right after a step, less its history. At small strain `along` is u.
WindowStack::Evaluated Elastic::tissueForce(Field y, Field along) noexcept
{
    WindowStack::Evaluated now = stack_.evaluate(Field::u, y, along, options_.law);
    if (volume::isSmall(options_.law)) {
        now.energy = -0.5 * now.product;
    }
    if (stack_.body().relaxes) {
        const auto [work, energy] = stack_.dots(Field::h, along, Field::u);
        stack_.combine(y, -1.0, Field::h, y);
        now.product -= work;
        now.energy += energy;
        historyEnergy_ = energy;
    }
    return now;
}

// A body that no tool touches, and that still has a history. That is gone after ten of its longest times: what is left then
// are cells that springs of a hostile hand turned inside out, and that would stay so.
bool Elastic::springsBack() const noexcept
{
    return stack_.body().relaxes && !atRest_ && untouchedFor_ < forgets * volume::relaxationTimes.back() &&
           std::max(std::abs(energy_), std::abs(stack_.dot(Field::h, Field::u))) >= minEnergy;
}

// What the time since the last call does to the history, where the tissue has lain. By turns: one evaluation of a term.
void Elastic::remember(int periods) noexcept
{
    if (!stack_.body().relaxes) {
        return;
    }
    if (givenFor_ > 0) {
        --givenFor_;
        takeGiven();
        return;
    }
    for (int& since : since_) {
        since += periods;
    }
    untilTurn_ = untilTurn_ > 0 ? untilTurn_ - 1 : callsPerTurn - 1;
    if (untilTurn_ > 0) {
        return;
    }
    const std::size_t term = std::exchange(term_, (term_ + 1) % volume::relaxationTerms);
    const double seconds = std::exchange(since_[term], 0) * options_.period;
    const double fraction = -std::expm1(-seconds / volume::relaxationTimes[term]);
    const Field history = WindowStack::history(term);
    stack_.evaluateTerm(term, Field::f, options_.law);
    stack_.combine(Field::f, -1.0, history, Field::f);
    const auto work = stack_.dots(Field::f, Field::u, Field::d);
    stack_.combine(history, fraction, Field::f, history);
    stack_.combine(Field::h, fraction, Field::f, Field::h);
    stack_.combine(Field::a, -fraction, Field::f, Field::a);
    energy_ += fraction * work[0];
    historyEnergy_ += fraction * work[0];
    if (products_) {
        (*products_)[0] -= fraction * work[0];
        (*products_)[1] -= fraction * increment_ * work[1];
    }
}

Elastic::HistoryShares Elastic::historyShares() noexcept
{
    HistoryShares fractions{};
    for (std::size_t i = 0; i < fractions.size() && stack_.body().relaxes && !atRest_; ++i) {
        stack_.evaluateTerm(i, Field::f, options_.law);
        const double fraction = stack_.dot(Field::u, WindowStack::history(i)) / stack_.dot(Field::u, Field::f);
        fractions[i] = std::isfinite(fraction) ? std::clamp(fraction, 0.0, 1.0) : 0.0;
    }
    return fractions;
}

void Elastic::beginWith(const HistoryShares& fractions) noexcept
{
    given_ = fractions;
    givenFor_ = callsOfGiven;
}

// The history that another body's windows had, at this displacement.
void Elastic::takeGiven() noexcept
{
    for (std::size_t i = 0; i < given_.size(); ++i) {
        const Field history = WindowStack::history(i);
        stack_.evaluateTerm(i, history, options_.law);
        stack_.combine(history, given_[i] - 1.0, history, history);
    }
    stack_.combine(WindowStack::history(0), 1.0, WindowStack::history(1), Field::h);
    refreshForces();
}

// The tissue's forces anew, where they cannot be carried along.
void Elastic::refreshForces() noexcept
{
    products_.reset();
    stack_.joinBorders(Field::u);
    energy_ = tissueForce(Field::a, Field::u).energy;
    if (hasIncrement_) {
        stack_.joinBorders(Field::d);
        stack_.apply(Field::d, Field::e);
    }
}

// r = forces of the tissue and of the contacts, whose sizes it adds up. Returns its norm.
double Elastic::refreshResidual() noexcept
{
    if (!std::exchange(course_.isCopied, false)) {
        stack_.copy(Field::a, Field::r);
    }
    addContactForces();
    return std::sqrt(stack_.dot(Field::r, Field::r));
}

void Elastic::addContactForces() noexcept
{
    contactForce_ = 0.0;
    const auto forceOf = [&](const ContactSite& s) {
        contactForce_ += glm::length(s.force);
        return s.force;
    };
    addByCell(sites(), forceOf, [&](const ContactSite& s, int corner, Vec3 force) {
        stack_.addForce(s.level, stack_[s.level].layout.corner(s.node, corner), force);
    });
}

void Elastic::prepareContacts() noexcept
{
    multigrid_.clearContacts();
    addByCell(sites(), tangentOf, [&](const ContactSite& s, int corner, const glm::dmat3& tangent) {
        multigrid_.addContact(s.level, stack_[s.level].layout.corner(s.node, corner), tangent);
    });
    multigrid_.prepare();
}

// Moves the windows to where the load has them. True when any moved: contacts have to be found again.
bool Elastic::follow(const ElasticLoad& load) noexcept
{
    multigrid_.clearContacts();
    return stack_.follow(whereItSticks(load), !atRest_);
}

// Bending modes are relieved where cells are narrow beside every tool, and none shears them by friction. It stays as it is
// while the tissue is deformed, since a change would be felt.
void Elastic::relieve(std::span<const ElasticTool> tools) noexcept
{
    double radius = tools.empty() ? 0.0 : std::numeric_limits<double>::infinity();
    double friction = 0.0;
    for (const ElasticTool& tool : tools) {
        radius = std::min({radius, tool.shape.radiusA, tool.shape.radiusB});
        friction = std::max(friction, tool.friction);
    }
    const double slips = std::clamp(1.0 - friction / notRelieved, 0.0, 1.0);
    for (std::size_t l = 0; l < stack_.windows().size(); ++l) {
        const double cells = radius / stack_.body().levels[l].nodes.spacing;
        const double isWide = std::clamp((cells - relievedFrom) / (relievedAll - relievedFrom), 0.0, 1.0);
        stack_[l].relief = static_cast<float>(slips * isWide);
    }
}

// The tissue that sticks to a tool stays behind the tool's place over the surface at rest, and windows belong around the
// tissue. By how much follows from the tool's way alone: were it taken from the solution, windows and slip would drive each
// other.
Focus Elastic::whereItSticks(const ElasticLoad& load) noexcept
{
    Focus focus = load.focus;
    const bool isLed = load.led < std::min(held_.size(), load.tools.size());
    const double most = isLed ? slipsWhole * load.tools[load.led].friction * held_[load.led].given : 0.0;
    if (most <= 0.0) {
        stuck_.reset();
        return focus;
    }
    Vec3 back = stuck_.value_or(focus.point) - focus.point;
    back -= glm::dot(back, focus.inward) * focus.inward;
    const double length = glm::length(back);
    focus.point += length > most ? most / length * back : back;
    stuck_ = focus.point;
    return focus;
}

// Virtual work along the displacement itself: the tissue's own, over that of the contacts.
void Elastic::balance() noexcept
{
    const double tissue = -(products_ ? (*products_)[0] : stack_.dot(Field::a, Field::u));
    double contacts = 0.0;
    for (const ContactSite& s : sites()) {
        contacts += glm::dot(s.force, s.u);
    }
    balance_ = contacts > 0.0 ? std::clamp(tissue / contacts, 1.0 / maxBalance, maxBalance) : 1.0;
}

// What the force along the surface lacks short of balance: the forces out of balance times what the displacement does when
// the tool moves along. Without friction the dent moves with it: by -du/dx, exact where the body is the same all along, and
// has no history.
void Elastic::findLag() noexcept
{
    const auto touches = [](const HeldTool& held) { return held.load > 0.0; };
    const auto only = std::ranges::find_if(held_, touches);
    const bool hasTies = siteCount_ > touching_;
    if (hasTies || only == held_.end() || only->friction > 0.0 || std::any_of(only + 1, held_.end(), touches)) {
        return;
    }
    if (!course_.isKnown) {
        // Of the finest window alone, which alongSlopes() looks at.
        course_.isCopied = false;
        Window& w = stack_[0];
        std::memcpy(w.field(Field::r), w.field(Field::a), 3 * w.layout.count * sizeof(float));
        addContactForces();
    }
    const Vec3 all = stack_.alongSlopes(Field::r, Field::u);
    only->lag = all - glm::dot(all, only->inward) * only->inward;
}

void Elastic::measure(ElasticResult& result) noexcept
{
    result.energy = energy_ + contactEnergy_;
    for (HeldTool& held : held_) {
        held.forgetContacts();
        held.loaded = held.given;
        result.behind = std::max(result.behind, held.behind);
    }
    StretchAt stretchAt(stack_, options_.law);
    for (ContactSite& s : active()) {
        s.stretch = 0.0;
        if (!s.isTie && s.active()) {
            ++result.contacts;
            result.depth = std::max(result.depth, s.depth);
            HeldTool& held = held_[s.owner];
            held.depth = std::max(held.depth, s.depth);
            held.sunk = std::max(held.sunk, s.depth * static_cast<double>(s.resolved));
            const double push = glm::length(s.force);
            held.load += push;
            held.under += s.isSubsurface ? push : 0.0;
            held.onEnds += isOnEnd(tools_[s.owner].shape, s.normal) ? push : 0.0;
            const Stretch now = stretchAt(s);
            held.indented += push * now.modulus * static_cast<double>(s.indented);
            s.stretch = now.area;
            s.stiffer = static_cast<float>(now.modulus);
            held.stretch = std::max(held.stretch, s.stretch);
            held.felt -= balance_ * s.force;
        }
    }
}

// What the residual is measured by. Tissue that springs back under a tool that lifts off has more force than the contact.
double Elastic::loadForce() const noexcept
{
    return stack_.body().relaxes ? std::max(contactForce_, std::sqrt(stack_.dot(Field::h, Field::h))) : contactForce_;
}

// Each tool's force from where the windows were to where they are. What is solved otherwise than tick by tick has its own.
void Elastic::blendMoves(bool isTick, bool moved) noexcept
{
    for (std::size_t i = 0; i < held_.size(); ++i) {
        HeldTool& held = held_[i];
        if (isTick) {
            held.blend.count(held.ownForce(), tools_[i].shape.a + held.behind * held.inward, moved);
        } else {
            held.blend.forget();
        }
    }
}

Vec3 Elastic::toolForce(std::size_t i) const noexcept
{
    return i < held_.size() ? held_[i].force() : Vec3(0.0);
}

Vec3 Elastic::tieForce(std::size_t i) const noexcept
{
    Vec3 sum(0.0);
    for (const ContactSite& s : sites().subspan(touching_)) {
        if (s.owner == i) {
            sum -= balance_ * s.force;
        }
    }
    return sum;
}

}  // namespace palpate::chainmail

#include <chainmail/elastic.h>

#include <glm/geometric.hpp>

#include <algorithm>
#include <cmath>

namespace palpate::chainmail {

namespace {

constexpr std::size_t mostTools = 16;
constexpr int newtonSteps = 3;     // of a line search: contacts open and close along it
constexpr int mostHalvings = 8;    // of a step that raises the energy
constexpr int mostFiniteTrials = 4;
constexpr int refreshPeriod = 256;  // calls after which forces that are carried along are computed anew
constexpr double rounding = 1e-6;  // relative: sums of single-precision products are no better

std::size_t cornerNode(const Layout& l, std::size_t node, int c) noexcept
{
    return node + static_cast<std::size_t>(c & 1) + (static_cast<std::size_t>(c >> 1) & 1) * l.row +
           (static_cast<std::size_t>(c >> 2) & 1) * l.plane;
}

}  // namespace

Elastic::Elastic(const ElasticBody& body, const ElasticOptions& options, Vec3 focus)
    : options_(options),
      stack_(body, options.window, focus),
      multigrid_(stack_, 8 * options.maxSites),
      sites_(options.maxSites)
{
    shapes_.reserve(mostTools);
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

void Elastic::settle() noexcept
{
    siteCount_ = 0;
    if (atRest_) {
        return;
    }
    for (const Field f : {Field::u, Field::a, Field::d, Field::e, Field::r}) {
        stack_.clear(f);
    }
    energy_ = 0.0;
    atRest_ = true;
    hasIncrement_ = false;
}

void Elastic::meet(const ElasticLoad& load) noexcept
{
    shapes_.clear();
    for (const ElasticTool& tool : load.tools.first(std::min(load.tools.size(), mostTools))) {
        shapes_.emplace_back(tool.shape);
    }
    ties_ = load.ties;
    siteCount_ = findSites(stack_.body(), stack_.windows(), load, shapes_, sites_);
}

ContactPush Elastic::push(const ContactSite& site, double alpha) const noexcept
{
    return pushAt(site, site.u + alpha * site.p, shapes_, ties_);
}

// The tissue's forces anew, where they cannot be carried along.
void Elastic::refreshForces() noexcept
{
    if (options_.finiteStrain) {
        energy_ = stack_.applyFinite(Field::u, Field::a);
    } else {
        stack_.apply(Field::u, Field::a);
    }
    if (hasIncrement_) {
        stack_.apply(Field::d, Field::e);
    }
}

// r = forces of the tissue and of the contacts.
void Elastic::refreshResidual() noexcept
{
    const Kernels& k = stack_.kernels();
    for (Window& w : stack_.windows()) {
        k.smoothFirst(1.0F, w.dof.data(), w.field(Field::a), w.field(Field::r), w.layout.count);
    }
    for (ContactSite& s : sites()) {
        s.p = Vec3(0.0);
        const Vec3 f = push(s, 0.0).force;
        if (f == Vec3(0.0)) {
            continue;
        }
        const Layout& l = stack_[s.level].layout;
        for (int c = 0; c < 8; ++c) {
            stack_.addForce(s.level, cornerNode(l, s.node, c),
                            static_cast<double>(s.share[static_cast<std::size_t>(c)]) * f);
        }
    }
}

void Elastic::prepareContacts() noexcept
{
    multigrid_.clearContacts();
    for (const ContactSite& s : sites()) {
        const ContactPush at = push(s, 0.0);
        if (at.energy <= 0.0 && !s.isTie) {
            continue;
        }
        const Layout& l = stack_[s.level].layout;
        for (int c = 0; c < 8; ++c) {
            const double share = static_cast<double>(s.share[static_cast<std::size_t>(c)]);
            if (share > 0.0) {
                multigrid_.addContact(s.level, cornerNode(l, s.node, c), share * at.tangent);
            }
        }
    }
    multigrid_.prepare();
}

void Elastic::look(Field direction) noexcept
{
    for (ContactSite& s : sites()) {
        s.p = gather(stack_.windows(), s, direction);
    }
}

Elastic::Along Elastic::contactsAlong(double alpha) const noexcept
{
    Along sum;
    for (const ContactSite& s : sites()) {
        const ContactPush at = push(s, alpha);
        sum.energy += at.energy;
        sum.slope -= glm::dot(at.force, s.p);
        sum.curvature += glm::dot(s.p, at.tangent * s.p);
    }
    return sum;
}

// Field `a`, times the contacts' stiffness, times the direction that look() saw.
double Elastic::contactProduct(Field a) const noexcept
{
    double sum = 0.0;
    for (const ContactSite& s : sites()) {
        const ContactPush at = push(s, 0.0);
        if (at.energy > 0.0 || s.isTie) {
            sum += glm::dot(gather(stack_.windows(), s, a), at.tangent * s.p);
        }
    }
    return sum;
}

// How far to go: Newton on the slope of the energy, the tissue's part a parabola, then the check on the energy itself.
double Elastic::lineSearch(double slope, double curvature, ElasticResult& result) const noexcept
{
    const Along start = contactsAlong(0.0);
    const double stiffness = curvature + start.curvature;
    if (!(stiffness > 0.0) || !std::isfinite(stiffness)) {
        return 0.0;
    }
    double alpha = -(slope + start.slope) / stiffness;
    for (int i = 0; i < newtonSteps; ++i) {
        const Along at = contactsAlong(alpha);
        alpha -= (slope + alpha * curvature + at.slope) / (curvature + at.curvature);
    }
    const double scale = std::abs(start.energy) + std::abs(slope * alpha);
    for (int i = 0; i <= mostHalvings; ++i) {
        const double change = (slope + 0.5 * curvature * alpha) * alpha + contactsAlong(alpha).energy - start.energy;
        if (change <= rounding * scale) {
            return alpha;
        }
        alpha *= 0.5;
        ++result.shortened;
    }
    return 0.0;
}

// Goes along a direction whose image under -A is known, as far as lowers the energy. False: nowhere.
bool Elastic::takeStep(Field direction, Field image, ElasticResult& result) noexcept
{
    look(direction);
    const double slope = -stack_.dot(Field::a, direction);
    const double curvature = -stack_.dot(image, direction);
    double alpha = lineSearch(slope, curvature, result);
    if (!std::isfinite(alpha)) {
        alpha = 0.0;
    }
    if (options_.finiteStrain) {
        alpha = tryFinite(direction, alpha, result);
    } else if (alpha != 0.0) {
        stack_.add(alpha, direction, Field::u);
        stack_.add(alpha, image, Field::a);
    }
    for (ContactSite& s : sites()) {
        s.u += alpha * s.p;
    }
    // The increment of this call so far: what was kept of the last one's, and the steps since.
    const double kept = direction == Field::d ? alpha - 1.0 : alpha;
    stack_.add(kept, direction, Field::d);
    stack_.add(kept, image, Field::e);
    return alpha != 0.0;
}

// The parabola is not the energy in finite strain: goes there and looks. Leaves the tissue's forces and energy.
double Elastic::tryFinite(Field direction, double alpha, ElasticResult& result) noexcept
{
    const double before = energy_ + contactsAlong(0.0).energy;
    double gone = 0.0;
    for (int i = 0; i <= mostFiniteTrials && alpha != 0.0; ++i) {
        stack_.add(alpha - gone, direction, Field::u);
        gone = alpha;
        energy_ = stack_.applyFinite(Field::u, Field::a);
        if (energy_ + contactsAlong(alpha).energy <= before + rounding * std::abs(before)) {
            return alpha;
        }
        alpha = i < mostFiniteTrials ? 0.5 * alpha : 0.0;
        ++result.shortened;
    }
    if (gone != 0.0) {
        stack_.add(-gone, direction, Field::u);
        energy_ = stack_.applyFinite(Field::u, Field::a);
    }
    return 0.0;
}

// One step of preconditioned conjugate gradients, conjugate to `before`.
bool Elastic::oneCycle(Before before, ElasticResult& result) noexcept
{
    prepareContacts();
    multigrid_.solve();
    stack_.apply(Field::z, Field::f);
    if (before == Before::increment) {
        stack_.copy(Field::d, Field::p);
        stack_.copy(Field::e, Field::q);
    }
    double beta = 0.0;
    if (before != Before::none) {
        look(Field::p);
        const double own = -stack_.dot(Field::p, Field::q) + contactProduct(Field::p);
        const double mixed = -stack_.dot(Field::z, Field::q) + contactProduct(Field::z);
        beta = own > 0.0 && std::isfinite(mixed / own) ? -mixed / own : 0.0;
    }
    stack_.scaleAdd(Field::z, beta, Field::p);
    stack_.scaleAdd(Field::f, beta, Field::q);
    return takeStep(Field::p, Field::q, result);
}

ElasticResult Elastic::relax(const ElasticLoad& load, int cycles, double tolerance) noexcept
{
    ElasticResult result;
    multigrid_.clearContacts();
    result.moved = stack_.follow(load.focus, !atRest_);
    meet(load);
    if (!touched()) {
        settle();
        return result;
    }
    atRest_ = false;
    if (result.moved || ++sinceRefresh_ >= refreshPeriod) {
        refreshForces();
        sinceRefresh_ = 0;
    }
    Before before = Before::none;
    if (hasIncrement_ && takeStep(Field::d, Field::e, result)) {
        before = Before::increment;
    } else {
        stack_.clear(Field::d);
        stack_.clear(Field::e);
    }
    hasIncrement_ = true;
    for (int i = 0; i < cycles; ++i) {
        refreshResidual();
        if (tolerance > 0.0) {
            result.residual = std::sqrt(stack_.dot(Field::r, Field::r));
            if (result.residual <= tolerance * contactForce()) {
                break;
            }
        }
        ++result.cycles;
        before = oneCycle(before, result) ? Before::direction : Before::none;
    }
    measure(result);
    return result;
}

// True when a tool is inside the tissue, as it lies or as it would lie at rest.
bool Elastic::touched() const noexcept
{
    return std::any_of(sites_.begin(), sites_.begin() + static_cast<std::ptrdiff_t>(siteCount_), [&](const auto& s) {
        return s.isTie || pushAt(s, s.u, shapes_, ties_).energy > 0.0 ||
               pushAt(s, Vec3(0.0), shapes_, ties_).energy > 0.0;
    });
}

void Elastic::measure(ElasticResult& result) const noexcept
{
    result.energy = options_.finiteStrain ? energy_ : -0.5 * stack_.dot(Field::u, Field::a);
    for (const ContactSite& s : sites()) {
        const ContactPush at = pushAt(s, s.u, shapes_, ties_);
        result.energy += at.energy;
        if (!s.isTie && at.energy > 0.0) {
            ++result.contacts;
            result.depth = std::max(result.depth, -shapes_[s.owner].distance(s.rest + s.u));
        }
    }
}

// Sum of the contacts' forces, each by its size [N].
double Elastic::contactForce() const noexcept
{
    double sum = 0.0;
    for (const ContactSite& s : sites()) {
        sum += glm::length(pushAt(s, s.u, shapes_, ties_).force);
    }
    return sum;
}

Vec3 Elastic::force(std::size_t owner, bool isTie) const noexcept
{
    Vec3 sum(0.0);
    for (const ContactSite& s : sites()) {
        if (s.owner == owner && s.isTie == isTie) {
            sum -= pushAt(s, s.u, shapes_, ties_).force;
        }
    }
    return sum;
}

}  // namespace palpate::chainmail

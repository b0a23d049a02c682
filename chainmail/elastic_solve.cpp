// The solution of one load, in one call or in parts.
#include <chainmail/elastic.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace palpate::chainmail {

namespace {

constexpr double afterMove = 3.0;   // a second cycle in a tick in which windows move: for so much more out of balance
constexpr int refreshPeriod = 256;  // calls after which forces that are carried along are computed anew

}  // namespace

ElasticResult Elastic::begin(const ElasticLoad& load) noexcept
{
    if (!follow(load)) {
        return relaxWhile(load, part());
    }
    // To move the windows is work enough for a call. Tissue at rest has no forces.
    course_.isOpen = false;
    if (!atRest_) {
        refreshForces();
        sinceRefresh_ = 0;
    }
    const int lost = waiting_ ? waiting_->periods : 0;
    waiting_ = load;
    waiting_->periods += lost;
    return {.moved = true};
}

ElasticResult Elastic::relaxWhile(const ElasticLoad& all, const Effort& effort) noexcept
{
    ElasticResult result;
    ElasticLoad load = all;
    const bool hasMoved = waiting_.has_value();
    load.periods += hasMoved ? waiting_->periods : 0;  // of a load that was never solved
    waiting_.reset();
    if (std::exchange(course_.isOpen, false) && !atRest_) {
        refreshForces();  // the last load was only met
    }
    load.tools = heldTools(load.tools.first(std::min(load.tools.size(), maxTools)), effort.isTick);
    if (atRest_) {
        relieve(load.tools);
    }
    const bool moves = follow(load);
    result.moved = moves || hasMoved;
    meet(load, result.moved);
    const bool isTouched = touched();
    untouchedFor_ = isTouched ? 0.0 : untouchedFor_ + load.periods * options_.period;
    if (!isTouched && !springsBack()) {
        settle();
        return result;
    }
    const bool hasLain = !std::exchange(atRest_, false);
    if (moves || (!hasMoved && ++sinceRefresh_ >= refreshPeriod)) {
        refreshForces();
        sinceRefresh_ = 0;
    }
    if (hasLain) {
        remember(load.periods);
    }
    course_ = {.effort = effort, .start = energy_ + contactEnergy_};
    result.start = course_.start;
    startEnergy_ = energy_;
    if (hasIncrement_) {
        course_.isCopied = warmStart(result);
        course_.isOpen = course_.isCopied && !volume::isSmall(options_.law);
    } else {
        forgetIncrement();
    }
    hasIncrement_ = options_.warmStart;
    // No hand feels tissue that springs back.
    course_.usual = isTouched ? effort.cycles : 1;
    course_.last = course_.usual + (isTouched && effort.far > 0.0 ? 1 : 0);
    if (!effort.inParts || !course_.isCopied) {
        solve(effort.inParts ? 1 : course_.last, result);
    }
    finish(result);
    blendMoves(effort.isTick && !effort.inParts, result.moved);
    return result;
}

ElasticResult Elastic::goOn(bool isLast) noexcept
{
    if (waiting_) {
        const ElasticLoad load = *waiting_;
        waiting_->periods = 0;  // it is this one
        return relaxWhile(load, part());
    }
    Course& c = course_;
    ElasticResult result;
    if (atRest_ || c.next >= c.last) {
        return result;
    }
    result.start = energy_ + contactEnergy_;
    result.cycles = static_cast<std::uint32_t>(c.next);
    if (!c.isHalf) {
        result.residual = refreshResidual();
        if (isBalanced(result.residual, toleranceOf(result))) {
            endBalanced();
        } else if (!isLast || c.next == 0) {
            prepareContacts();
            multigrid_.solve();
            c.isHalf = true;
            if (!isLast) {
                return result;
            }
        }
    }
    if (std::exchange(c.isHalf, false)) {
        ++result.cycles;
        endCycle(result);
        ++c.next;
    }
    close(result);
    finish(result);
    return result;
}

bool Elastic::isBalanced(double residual, double tolerance) const noexcept
{
    const double unfelt = course_.next < course_.usual ? 0.0 : options_.unfelt;
    return tolerance > 0.0 && residual <= std::max(tolerance * loadForce(), unfelt);
}

// Up to which the cycle that comes next is not needed, as a fraction of the contacts' forces.
double Elastic::toleranceOf(const ElasticResult& result) const noexcept
{
    const Course& c = course_;
    const double further = (result.moved && c.effort.isTick ? afterMove : 1.0) * c.effort.further;
    return c.next == 0 ? c.effort.first : c.next < c.usual ? further : c.effort.far;
}

void Elastic::endBalanced() noexcept
{
    course_.isKnown = !course_.isOpen;
    course_.next = course_.last;
}

// A cycle, whose correction is known.
void Elastic::endCycle(ElasticResult& result) noexcept
{
    Course& c = course_;
    const bool hasGone = step(c.isOpen ? c.start : noLimit, result);
    if (!hasGone && c.isOpen && !confirm(c.start)) {
        again(result);
    } else if (!hasGone) {
        refreshForces();
        forgetStep();
    }
    c.isOpen = false;
}

// Evaluates the force where the tissue is, if it was only carried along.
void Elastic::close(ElasticResult& result) noexcept
{
    if (std::exchange(course_.isOpen, false) && !confirm(course_.start)) {
        again(result);
    }
}

// Cycles until the forces are balanced, `most` at most. The force is evaluated where that ends.
void Elastic::solve(int most, ElasticResult& result) noexcept
{
    Course& c = course_;
    for (int i = 0; c.next < c.last && i < most; ++c.next, ++i) {
        result.residual = refreshResidual();
        if (isBalanced(result.residual, toleranceOf(result))) {
            if (!c.isOpen || c.effort.isTick) {
                endBalanced();
                break;
            }
            // The force was carried along; it may be another where the tissue is now.
            c.isOpen = false;
            if (confirm(c.start)) {
                refreshForces();
            } else {
                again(result);
            }
            continue;
        }
        ++result.cycles;
        prepareContacts();
        multigrid_.solve();
        endCycle(result);
    }
    close(result);
}

void Elastic::finish(ElasticResult& result) noexcept
{
    if (!std::isfinite(energy_ + contactEnergy_)) {
        startAnew();
        return;
    }
    letSlip();
    balance();
    measure(result);
    if (!course_.isOpen) {
        findLag();
    }
}

}  // namespace palpate::chainmail

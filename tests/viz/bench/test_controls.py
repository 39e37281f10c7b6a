"""Controls of the page follow commands of others; the list of faults is no markup."""

from tests.waiting import wait_for


def test_faults_are_listed_as_text_from_0_on(page, bench):
    box = page._faults_tab._list
    wait_for(lambda: "no faults" in box.content)
    bench.now.faults = ("coil.00 open", "<b>adc</b> noise")
    wait_for(lambda: "<li>coil.00 open</li><li>&lt;b&gt;adc&lt;/b&gt; noise</li>" in box.content)
    assert 'start="0"' in box.content
    bench.now.faults = ()
    wait_for(lambda: "no faults" in box.content)

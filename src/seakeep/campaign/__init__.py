"""Campaigns: a TOML file and raw recordings become analysis-ready runs."""

from seakeep.campaign.drafts import draft_campaign
from seakeep.campaign.live_chain import LiveChain
from seakeep.campaign.prepare import Campaign, load_prepared, read_campaign, write_prepared
from seakeep.campaign.readers import read_table
from seakeep.campaign.settings import ModelSettings

__all__ = [
    "Campaign",
    "LiveChain",
    "ModelSettings",
    "draft_campaign",
    "load_prepared",
    "read_campaign",
    "read_table",
    "write_prepared",
]
